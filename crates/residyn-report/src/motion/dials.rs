//! Joints drawn separately, if it is not known how they are connected: hands of dials, marks on rails.

use std::f64::consts::TAU;

use super::sketch::{PictureEntry, Point, Sketch};
use super::{Frames, Tracks};
use crate::headline::label;
use crate::plot_data::span;
use residyn_core::closeloop::Outcome;
use residyn_core::data::Joint;

/// Corners of a dial's rim.
const CORNERS: u32 = 72;
/// Length of the mark at a dial's zero, as a share of its radius.
const MARK: f64 = 0.15;
/// Height of a mark on a rail, as a share of the rail.
const HEIGHT: f64 = 0.3;

/// How the joints are drawn, and a picture of each.
pub(super) fn drawn(outcome: &Outcome, tracks: &Tracks) -> (&'static str, Vec<PictureEntry>) {
    let picture = |joint: Joint| {
        let about = format!("joint {}", label(outcome, joint));
        match outcome.given.prismatic[joint] {
            true => rail(about, joint, &tracks[0]).moved(tracks),
            false => dial(about, joint).moved(tracks),
        }
    };
    let words = "The equations do not say how the joints are connected, so each is drawn by itself: an angle turns a hand \
                 anticlockwise from the mark, a sliding joint moves along a rail.";
    let joints = Joint::all(outcome.given.prismatic.len());
    (words, joints.map(picture).collect())
}

fn dial(about: String, joint: Joint) -> Sketch<impl Fn(&[f64]) -> Vec<Point>> {
    let at = |radius: f64, angle: f64| [radius * angle.cos(), radius * angle.sin()];
    let rim = (0..=CORNERS).map(|k| at(1.0, TAU * f64::from(k) / f64::from(CORNERS)));
    Sketch {
        about,
        low: [-1.0; 2],
        high: [1.0; 2],
        ground: std::iter::once(at(1.0 - MARK, 0.0)).chain(rim).collect(),
        line: move |q: &[f64]| vec![[0.0; 2], at(1.0, q[joint])],
    }
}

fn rail(about: String, joint: Joint, measured: &Frames) -> Sketch<impl Fn(&[f64]) -> Vec<Point>> {
    let [low, high] = span(measured.iter().map(|q| q[joint]));
    let length = (high - low).max(f64::MIN_POSITIVE);
    let height = HEIGHT * length;
    Sketch {
        about,
        low: [low, -height],
        high: [low + length, height],
        ground: vec![[low, 0.0], [low + length, 0.0]],
        line: move |q: &[f64]| vec![[q[joint], -0.5 * height], [q[joint], 0.5 * height]],
    }
}

#[cfg(test)]
mod tests {
    use super::{dial, rail};
    use residyn_core::data::Joint;

    #[test]
    fn a_hand_turns_anticlockwise_and_a_mark_moves_along() {
        let joint = Joint::at(0);
        let quarter = vec![vec![0.0], vec![std::f64::consts::FRAC_PI_2]];
        let lost = vec![vec![0.0], vec![f64::NAN]];
        let drawn = dial("1".to_owned(), joint).moved(&[quarter.clone(), lost, quarter]);
        assert_eq!(drawn.measured, ["0,0 500,0", "0,0 0,-500"]);
        assert_eq!(drawn.before, ["0,0 500,0", ""]);
        let slid = vec![vec![0.5], vec![2.5]];
        let drawn =
            rail("1".to_owned(), joint, &slid).moved(&[slid.clone(), slid.clone(), slid.clone()]);
        assert_eq!(drawn.measured, ["250,150 250,-150", "1250,150 1250,-150"]);
        assert_eq!(drawn.ground, "250,0 1250,0");
    }
}
