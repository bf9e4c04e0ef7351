//! Play between a motor and its link: two ends, at which both push like a spring and a damper, and meet or part within a step.

use crate::expr::{Binary, Graph, Node, Unary};
use crate::model::internal_state::{SHORTEST_S, between, mean_of_two};

/// A range of the twist in which nothing passes.
#[derive(Clone, Copy)]
pub(super) struct Play {
    ends: [Node; 2],
    /// By how much the twist is beyond an end, zero within.
    pressed: Node,
    /// The torque that this much and the rate of the twist call for, and its slopes by both. It pushes, or nothing passes.
    called: Node,
    slopes: [Node; 2],
}

/// The relative motion at the start of a step: the twist and its rate, the rate of that rate, and by how much a torque between
/// the bodies changes it.
#[derive(Clone, Copy)]
pub(super) struct Relative {
    pub twist: [Node; 2],
    pub gaining: Node,
    pub mobility: Node,
    /// Length of the step, s.
    pub step: Node,
}

/// By how much a twist is beyond the nearer of two ends; zero between them.
pub(super) fn beyond(graph: &mut Graph, ends: [Node; 2], twist: Node) -> Node {
    let within = between(graph, ends, twist);
    graph.sub(twist, within)
}

impl Play {
    /// `called` at `at`: by how much the twist is beyond an end, and its rate.
    pub fn of(graph: &mut Graph, ends: [Node; 2], at: [Node; 2], called: Node) -> Self {
        let one = graph.constant(1.0);
        let slopes = graph.gradient(&[called], &[one], &at);
        Self {
            ends,
            pressed: at[0],
            called,
            slopes: [slopes[0], slopes[1]],
        }
    }

    /// Above zero where the bodies push.
    fn pushes(self, graph: &mut Graph) -> Node {
        graph.mul(self.pressed, self.called)
    }

    /// The torque that passes.
    pub fn passed(self, graph: &mut Graph) -> Node {
        let zero = graph.constant(0.0);
        let pushes = self.pushes(graph);
        graph.select(pushes, self.called, zero)
    }
}

impl Relative {
    /// The mean rates over a step in which the bodies may meet or part, from those of a step in which they do not.
    pub fn with_ends_of(self, graph: &mut Graph, play: Play, means: [Node; 2]) -> [Node; 2] {
        let [zero, one] = [0.0, 1.0].map(|value| graph.constant(value));
        let pushes = play.pushes(graph);
        let [twist, rate] = self.after(graph, means);
        // Where they push at the start, and what is called for at the end would pull.
        let [moved, gained] = [
            graph.sub(twist, self.twist[0]),
            graph.sub(rate, self.twist[1]),
        ];
        let more = graph.dot(&play.slopes, &[moved, gained]);
        let at_end = graph.add(play.called, more);
        let kept = graph.mul(play.called, at_end);
        let pulls = graph.binary(Binary::Less, kept, zero);
        let parts = graph.select(pushes, pulls, zero);
        let parted = self.parting(graph, play, at_end);
        // Where they do not, and the step ends beyond an end.
        let over = beyond(graph, play.ends, twist);
        let outside = graph.mul(play.pressed, play.pressed);
        let over = graph.mul(over, over);
        let over = graph.select(outside, zero, over);
        let meets = graph.select(pushes, zero, over);
        let met = self.meeting(graph, play, twist);
        let chosen = |graph: &mut Graph, [if_met, if_parted, else_both]: [Node; 3]| {
            let others = graph.select(parts, if_parted, else_both);
            graph.select(meets, if_met, others)
        };
        let shortest = graph.constant(SHORTEST_S);
        let step = graph.binary(Binary::Max, self.step, shortest);
        let per_step = graph.div(one, step);
        [0, 1].map(|k| {
            let [met, parted] = [met[k], parted[k]].map(|end| {
                let way = graph.sub(end, self.twist[k]);
                graph.mul(way, per_step)
            });
            chosen(graph, [met, parted, means[k]])
        })
    }

    /// The twist and its rate after the step, from the mean rates.
    fn after(self, graph: &mut Graph, means: [Node; 2]) -> [Node; 2] {
        [0, 1].map(|k| {
            let way = graph.mul(self.step, means[k]);
            graph.add(self.twist[k], way)
        })
    }

    /// The twist and its rate after a time in which this relative acceleration stays.
    fn freely(graph: &mut Graph, [twist, rate]: [Node; 2], gaining: Node, time: Node) -> [Node; 2] {
        let half = graph.constant(0.5);
        let gained = graph.mul(gaining, time);
        let of_gained = graph.mul(half, gained);
        let mean = graph.add(rate, of_gained);
        let way = graph.mul(mean, time);
        [graph.add(twist, way), graph.add(rate, gained)]
    }

    /// The twist and its rate after a time in which the bodies push, from a state in which they have this relative acceleration.
    fn pushing(
        self,
        graph: &mut Graph,
        play: Play,
        (from, gaining, time): ([Node; 2], Node, Node),
    ) -> [Node; 2] {
        let zero = graph.constant(0.0);
        let slope = |graph: &mut Graph, k: usize| {
            let scaled = graph.mul(play.slopes[k], self.mobility);
            let over_time = graph.mul(scaled, time);
            graph.neg(over_time)
        };
        let growth = [[zero, time], [slope(graph, 0), slope(graph, 1)]];
        let means = mean_of_two(graph, [from[1], gaining], growth);
        [0, 1].map(|k| {
            let way = graph.mul(time, means[k]);
            graph.add(from[k], way)
        })
    }

    /// The end of a step in which the bodies part, whose end would call for `at_end` if they did not.
    fn parting(self, graph: &mut Graph, play: Play, at_end: Node) -> [Node; 2] {
        let [zero, one, tiny] = [0.0, 1.0, 1e-12].map(|value| graph.constant(value));
        let fall = graph.sub(play.called, at_end);
        // Nothing of the kind where nothing falls.
        let square = graph.mul(fall, fall);
        let square = graph.add(square, tiny);
        let share = graph.mul(play.called, fall);
        let share = graph.div(share, square);
        let share = between(graph, [zero, one], share);
        let pushing = graph.mul(share, self.step);
        let parted = self.pushing(graph, play, (self.twist, self.gaining, pushing));
        let by_contact = graph.mul(self.mobility, play.called);
        let free = graph.add(self.gaining, by_contact);
        let left = graph.sub(self.step, pushing);
        Self::freely(graph, parted, free, left)
    }

    /// The end of a step in which the bodies meet, which would end at this twist if they did not.
    fn meeting(self, graph: &mut Graph, play: Play, twist: Node) -> [Node; 2] {
        let [zero, one, two, tiny] = [0.0, 1.0, 2.0, 1e-12].map(|value| graph.constant(value));
        let [low, high] = play.ends;
        let is_low = graph.binary(Binary::Less, twist, low);
        let other_way = graph.neg(one);
        let side = graph.select(is_low, other_way, one);
        let end = graph.select(is_low, low, high);
        let [rate, gaining] = [self.twist[1], self.gaining].map(|of| graph.mul(side, of));
        let gap = graph.sub(end, self.twist[0]);
        let gap = graph.mul(side, gap);
        // The first root of gap = rate * t + gaining * t^2 / 2.
        let twice = graph.mul(two, gap);
        let of_gap = graph.mul(twice, gaining);
        let square = graph.mul(rate, rate);
        let square = graph.add(square, of_gap);
        let square = graph.binary(Binary::Max, square, tiny);
        let root = graph.unary(Unary::Sqrt, square);
        let sum = graph.add(rate, root);
        let sum = graph.binary(Binary::Max, sum, tiny);
        let time = graph.div(twice, sum);
        let time = between(graph, [zero, self.step], time);
        let gained = graph.mul(self.gaining, time);
        let met = graph.add(self.twist[1], gained);
        let left = graph.sub(self.step, time);
        let called = graph.mul(play.slopes[1], met);
        let slowed = graph.mul(self.mobility, called);
        let gaining = graph.sub(self.gaining, slowed);
        self.pushing(graph, play, ([end, met], gaining, left))
    }
}

/// What a body that has this share in the relative motion moves over a step beyond the mean of its speeds at both ends, as a
/// rate: when within the step the bodies met.
pub(super) fn jump(
    graph: &mut Graph,
    [mean, gained]: [Node; 2],
    rate: Node,
    (share, step): (Node, Node),
) -> Node {
    let half = graph.constant(0.5);
    let half = graph.mul(half, step);
    let grown = graph.mul(half, gained);
    let of_speeds = graph.add(rate, grown);
    let beyond = graph.sub(mean, of_speeds);
    graph.mul(share, beyond)
}
