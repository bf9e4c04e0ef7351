//! An episode to watch.

use svg::node::element::{Animate, AnimateTransform, Group, Path};

use super::PlotError;
use super::axes::{Axis, FOOT, Frame, HEAD, Quantity, remark};
use super::canvas::{Area, Canvas, clipped, curves, dots, dots_data, line_data, px, rule};
use super::decimate::{decimate, drawable_pieces};
use super::legend::{Entry, Sample, with_key};
use super::scale::Range;
use super::style::{INK, MARGIN, SPINE, Stroke, WIDTH, numbered};

/// More than this, an eye does not tell from motion between the frames.
const FRAMES_PER_S: f64 = 25.0;
const STAGE_HEIGHT: f64 = 400.0;
const STRIP_HEIGHT: f64 = 126.0;
const STRIP_GAP: f64 = 14.0;
const LINK_PX: f64 = 10.0;
const JOINT_PX: f64 = 5.0;
/// As much of the tip's path as shows where it comes from, without the tangle of all that came before.
const TAIL_PX: f64 = 400.0;
/// Two for each column of pixels and some: more cannot be seen.
const MAX_STRIP_POINTS: usize = 2000;

/// An episode of a mechanism in a plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Animation {
    pub title: String,
    /// Time from one frame to the next in s.
    pub step_s: f64,
    /// The bodies, all with as many frames; at least one. The last point of the last one leaves a trace.
    pub chains: Vec<Chain>,
    /// What is shown over time below the motion, from the top.
    pub strips: Vec<Strip>,
}

/// Bars joined end to end.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    /// Ends and joints: `[frame][point]` as x and y in m, the same number of points in every frame.
    pub frames: Vec<Vec<[f64; 2]>>,
}

/// A quantity over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Strip {
    pub quantity: Quantity,
    /// One or more; more than one are named in the key.
    pub lines: Vec<StripLine>,
}

/// One line of a strip.
#[derive(Debug, Clone, PartialEq)]
pub struct StripLine {
    /// Its name in the key.
    pub label: String,
    /// One a step of the animation, the first at time 0.
    pub values: Vec<f64>,
}

/// A part of an episode as it is shown: evenly spaced frames, the first at time 0.
struct Motion {
    duration_s: f64,
    /// `[chain][frame][point]` in m.
    chains: Vec<Vec<Vec<(f64, f64)>>>,
}

/// Draws a film: one SVG document that plays an episode in real time, for ever, wherever SVG animations are played,
/// and elsewhere shows its last frame.
///
/// It has 25 frames a second at most, with straight motion between them. It ends before the first frame that has a
/// point that is not finite; a remark says so.
///
/// # Errors
/// No chain or no frame to show; chains that differ in their number of frames or change their number of points.
pub fn animation(episode: &Animation) -> Result<String, PlotError> {
    let motion = shown_motion(episode)?;
    let (mut canvas, top) = with_key(&episode.title, entries(&episode.strips));
    let strip_axes: Vec<Axis> = episode.strips.iter().map(strip_axis).collect();
    let stage = Stage::new(&motion, &strip_axes, top);
    let stage_frame = stage.frame();
    canvas.add(stage_frame.grid());
    canvas.add(stage_frame.x_labels());
    canvas.add(stage_frame.y_numbers());
    canvas.add(stage_frame.y_label());
    canvas.add(drawn_motion(&stage_frame, &motion));
    if let Some(end_s) = cut_s(episode) {
        let remarked = format!("the motion is not finite after {end_s:.2} s");
        canvas.add(remark(stage_frame.area, &remarked));
    }
    let area = Area {
        y: stage_frame.area.bottom() + FOOT,
        height: STRIP_HEIGHT,
        ..stage_frame.area
    };
    let bottom = draw_strips(&mut canvas, episode, &strip_axes, motion.duration_s, area);
    Ok(canvas.finish(bottom))
}

/// The frames to show of a sound animation.
fn shown_motion(episode: &Animation) -> Result<Motion, PlotError> {
    let title = || episode.title.clone();
    let count = episode.chains.first().map_or(0, |chain| chain.frames.len());
    let is_even = |chain: &Chain| {
        let mut sizes = chain.frames.iter().map(Vec::len);
        let first = sizes.next().unwrap_or(0);
        chain.frames.len() == count && first > 0 && sizes.all(|size| size == first)
    };
    let finite = finite_frames(episode);
    if finite == 0 {
        return Err(PlotError::Empty { title: title() });
    }
    if let Some(chain) = episode.chains.iter().position(|chain| !is_even(chain)) {
        let chain = chain + 1;
        return Err(PlotError::Uneven {
            title: title(),
            chain,
        });
    }
    let duration_s = episode.step_s * (finite - 1) as f64;
    // Rounding must not lose the last frame of a whole number of them.
    let shown = (duration_s * FRAMES_PER_S + 1e-6).floor() as usize + 1;
    let shown = shown.clamp(finite.min(2), finite);
    let chains = episode.chains.iter();
    Ok(Motion {
        duration_s,
        chains: chains
            .map(|chain| resampled(&chain.frames[..finite], shown))
            .collect(),
    })
}

/// How many frames come before the first with a point that is not finite.
fn finite_frames(episode: &Animation) -> usize {
    let finite = episode.chains.iter().map(|chain| {
        let is_finite = |frame: &&Vec<[f64; 2]>| frame.iter().flatten().all(|x| x.is_finite());
        chain.frames.iter().take_while(is_finite).count()
    });
    finite.min().unwrap_or(0)
}

/// When the motion ends, where that is before the episode does.
fn cut_s(episode: &Animation) -> Option<f64> {
    let finite = finite_frames(episode);
    let is_cut = episode
        .chains
        .iter()
        .any(|chain| chain.frames.len() > finite);
    is_cut.then(|| episode.step_s * (finite - 1) as f64)
}

/// Evenly spaced frames from the first to the last, straight in between.
fn resampled(frames: &[Vec<[f64; 2]>], shown: usize) -> Vec<Vec<(f64, f64)>> {
    let spacing = (frames.len() - 1) as f64 / (shown - 1).max(1) as f64;
    let frame = |index: usize| {
        let at = spacing * index as f64;
        let (before, part) = (at.floor() as usize, at.fract());
        let after = (before + 1).min(frames.len() - 1);
        let points = frames[before].iter().zip(&frames[after]);
        let between = |a: f64, b: f64| a + part * (b - a);
        points
            .map(|(a, b)| (between(a[0], b[0]), between(a[1], b[1])))
            .collect()
    };
    (0..shown).map(frame).collect()
}

fn entries(strips: &[Strip]) -> Vec<Entry> {
    let several = strips.iter().filter(|strip| strip.lines.len() > 1);
    let lines = several.flat_map(|strip| strip.lines.iter().enumerate());
    lines
        .map(|(k, line)| Entry::new(Sample::Line(numbered(k)), &line.label))
        .collect()
}

/// Where the motion is drawn: a metre is as long across as it is up.
struct Stage {
    area: Area,
    x: Axis,
    y: Axis,
}

impl Stage {
    fn new(motion: &Motion, strips: &[Axis], top: f64) -> Self {
        let (x, y) = (span(motion, |point| point.0), span(motion, |point| point.1));
        let y_axis = |range| Axis::vertical(range, STAGE_HEIGHT, "y", "m");
        // The numbers hardly change their width when the range is opened to the shape of the area.
        let gutters = strips.iter().map(Axis::gutter);
        let left = MARGIN + gutters.fold(y_axis(y).gutter(), f64::max);
        let width = WIDTH - left - MARGIN;
        let metre_px = (width / x.width()).min(STAGE_HEIGHT / y.width());
        Self {
            area: Area {
                x: left,
                y: top + HEAD,
                width,
                height: STAGE_HEIGHT,
            },
            x: Axis::horizontal(x.around_middle(width / metre_px), width, "x", "m"),
            y: y_axis(y.around_middle(STAGE_HEIGHT / metre_px)),
        }
    }

    fn frame(&self) -> Frame<'_> {
        Frame {
            area: self.area,
            x: &self.x,
            y: &self.y,
        }
    }
}

fn span(motion: &Motion, coordinate: impl Fn(&(f64, f64)) -> f64) -> Range {
    let points = motion.chains.iter().flatten().flatten();
    Range::spanning(points.map(coordinate))
        .unwrap_or(Range { lo: -1.0, hi: 1.0 })
        .drawable()
        .widened(0.08)
}

/// Trace, bars and joints; all of them lie within the stage. In a group, because browsers give an inner `svg` a clock
/// of its own, which need not run with the cursor's.
fn drawn_motion(stage: &Frame, motion: &Motion) -> Group {
    let chains: Vec<Vec<Vec<(f64, f64)>>> = motion
        .chains
        .iter()
        .map(|frames| {
            let frames = frames.iter();
            let in_px =
                |frame: &Vec<(f64, f64)>| frame.iter().map(|p| stage.point_px(*p)).collect();
            frames.map(in_px).collect()
        })
        .collect();
    let corner = format!("translate({} {})", px(stage.area.x), px(stage.area.y));
    let mut inner = Group::new().set("transform", corner);
    let colour = numbered(chains.len() - 1).colour;
    if let Some(last) = chains.last() {
        inner = inner.add(trace(last, motion.duration_s, colour));
    }
    for (k, frames) in chains.iter().enumerate() {
        let [bars, joints] = body(frames, motion.duration_s, numbered(k).colour);
        inner = inner.add(bars).add(joints);
    }
    inner
}

/// The latest part of the path of a chain's last point.
fn trace(frames: &[Vec<(f64, f64)>], duration_s: f64, colour: &'static str) -> Path {
    // Rounded first, so that lengths here are those in the file.
    let tips: Vec<(f64, f64)> = frames
        .iter()
        .filter_map(|points| points.last())
        .map(|(x, y)| (px(*x), px(*y)))
        .collect();
    let lengths = lengths_along(&tips);
    let whole = lengths.last().copied().unwrap_or(0.0);
    // A dash that ends at the tip: the offset is where in the dash the path begins.
    let offsets: Vec<String> = lengths
        .iter()
        .map(|length| px(TAIL_PX - length).to_string())
        .collect();
    let stroke = Stroke {
        colour,
        width: 2.4,
        dash: "none",
    };
    curves([tips.as_slice()], &stroke)
        .set("opacity", 0.45)
        .set("stroke-dasharray", format!("{TAIL_PX} {}", whole.ceil()))
        .set("stroke-dashoffset", px(TAIL_PX - whole))
        .add(animated("stroke-dashoffset", &offsets, duration_s))
}

/// Distance along a line from its first point to each of its points.
fn lengths_along(points: &[(f64, f64)]) -> Vec<f64> {
    let mut length = 0.0;
    let mut previous = points.first();
    let mut step = |point| {
        let (from, to): (&(f64, f64), &(f64, f64)) = (previous.unwrap_or(point), point);
        length += (to.0 - from.0).hypot(to.1 - from.1);
        previous = Some(point);
        length
    };
    points.iter().map(&mut step).collect()
}

/// The bars of a chain and its joints.
fn body(frames: &[Vec<(f64, f64)>], duration_s: f64, colour: &'static str) -> [Path; 2] {
    let stroke = Stroke {
        colour,
        width: LINK_PX,
        dash: "none",
    };
    let last = frames.last().map_or(&[][..], Vec::as_slice);
    let lines: Vec<String> = frames.iter().map(|points| line_data(points)).collect();
    let joints: Vec<String> = frames
        .iter()
        .map(|points| dots_data(points.iter().copied()))
        .collect();
    [
        curves([last], &stroke)
            .set("stroke-linecap", "round")
            .add(animated("d", &lines, duration_s)),
        dots(last.iter().copied(), JOINT_PX, "white").add(animated("d", &joints, duration_s)),
    ]
}

/// The values of an attribute at evenly spaced times, gone through again and again.
fn animated(attribute: &str, values: &[String], duration_s: f64) -> Animate {
    Animate::new()
        .set("attributeName", attribute)
        .set("values", values.join(";"))
        .set("dur", clock_value(duration_s))
        .set("repeatCount", "indefinite")
}

fn clock_value(duration_s: f64) -> String {
    format!("{duration_s:.3}s")
}

fn strip_axis(strip: &Strip) -> Axis {
    let values = strip.lines.iter().flat_map(|line| &line.values).copied();
    let range = Range::spanning(values)
        .unwrap_or(Range { lo: -1.0, hi: 1.0 })
        .drawable()
        .widened(0.08);
    let Quantity { name, unit } = &strip.quantity;
    Axis::vertical(range, STRIP_HEIGHT, name, unit)
}

/// Draws the strips from an area on over a common time axis, and says where they end.
fn draw_strips(
    canvas: &mut Canvas,
    episode: &Animation,
    axes: &[Axis],
    duration_s: f64,
    first: Area,
) -> f64 {
    let lines = episode.strips.iter().flat_map(|strip| &strip.lines);
    let times = lines.map(|line| episode.step_s * line.values.len() as f64 - episode.step_s);
    let range = Range {
        lo: 0.0,
        hi: times.fold(duration_s, f64::max),
    };
    let time = Axis::horizontal(range.drawable(), first.width, "time", "s");
    let mut area = first;
    for (k, (strip, y)) in episode.strips.iter().zip(axes).enumerate() {
        let frame = Frame { area, x: &time, y };
        draw_strip(canvas, &frame, strip, episode.step_s);
        if k + 1 < episode.strips.len() {
            area.y += STRIP_HEIGHT + STRIP_GAP;
        } else {
            canvas.add(frame.x_labels());
            canvas.add(cursor(&frame, first.y, duration_s));
        }
    }
    if episode.strips.is_empty() {
        first.y
    } else {
        area.bottom() + FOOT
    }
}

fn draw_strip(canvas: &mut Canvas, frame: &Frame, strip: &Strip, step_s: f64) {
    canvas.add(frame.grid());
    canvas.add(frame.y_numbers());
    canvas.add(frame.y_label());
    let mut inner = clipped(frame.area);
    for (k, line) in strip.lines.iter().enumerate() {
        let values = line.values.iter().enumerate();
        let points: Vec<(f64, f64)> = values.map(|(i, v)| (step_s * i as f64, *v)).collect();
        let pieces: Vec<Vec<(f64, f64)>> = drawable_pieces(&points)
            .map(|piece| {
                let kept = decimate(piece, MAX_STRIP_POINTS);
                kept.into_iter()
                    .map(|point| frame.point_px(point))
                    .collect()
            })
            .collect();
        inner = inner.add(curves(pieces.iter().map(Vec::as_slice), &numbered(k)));
    }
    canvas.add(inner);
}

/// A line across all strips that runs along with the motion.
fn cursor(last: &Frame, top: f64, duration_s: f64) -> Group {
    let [start, end] = [0.0, duration_s].map(|time| last.area.x + last.x_px(time));
    let run = AnimateTransform::new()
        .set("attributeName", "transform")
        .set("type", "translate")
        .set("from", px(start))
        .set("to", px(end))
        .set("dur", clock_value(duration_s))
        .set("repeatCount", "indefinite");
    Group::new()
        .set("transform", format!("translate({} 0)", px(end)))
        .add(rule((0.0, top), (0.0, last.area.bottom()), INK).set("stroke-width", 1.5))
        .add(dots([(0.0, top)], 7.0, SPINE))
        .add(run)
}

#[cfg(test)]
mod tests {
    use super::{
        Animation, Chain, Quantity, Strip, StripLine, animation, lengths_along, resampled,
    };
    use crate::report::plot::PlotError;

    /// Two links of 1 m that turn at different speeds.
    fn acrobot(frames: usize, step_s: f64) -> Animation {
        let pose = |k: usize| {
            let time = step_s * k as f64;
            let (a, b) = (2.0 * time.sin(), 5.0 * (0.7 * time).sin());
            let elbow = [a.sin(), -a.cos()];
            vec![[0.0, 0.0], elbow, [elbow[0] + b.sin(), elbow[1] - b.cos()]]
        };
        let line = |label: &str, rate: f64| StripLine {
            label: label.into(),
            values: (1..frames)
                .map(|k| (rate * step_s * k as f64).cos())
                .collect(),
        };
        let strip = |name, unit, lines| Strip {
            quantity: Quantity::new(name, unit),
            lines,
        };
        Animation {
            title: "acrobot".into(),
            step_s,
            chains: vec![Chain {
                frames: (0..frames).map(pose).collect(),
            }],
            strips: vec![
                strip(
                    "torque",
                    "N m",
                    vec![line("joint 1", 3.0), line("joint 2", 1.0)],
                ),
                strip("reward", "", vec![line("reward", 0.5)]),
            ],
        }
    }

    /// The key frames of each animated attribute.
    fn keyframes(film: &str) -> Vec<usize> {
        let lists = film.split("values=\"").skip(1);
        lists
            .map(|list| list.split('"').next().unwrap().split(';').count())
            .collect()
    }

    #[test]
    fn frames_are_kept_and_play_in_real_time() {
        let film = animation(&acrobot(51, 0.1)).unwrap();
        assert_eq!(keyframes(&film), [51, 51, 51], "trace, bars, joints");
        assert_eq!(film.matches("dur=\"5.000s\"").count(), 4, "and the cursor");
        assert_eq!(film.matches("repeatCount=\"indefinite\"").count(), 4);
    }

    #[test]
    fn fast_frames_are_thinned_and_a_long_film_stays_small() {
        let film = animation(&acrobot(1001, 0.02)).unwrap();
        assert_eq!(keyframes(&film), [501, 501, 501]);
        assert_eq!(film.matches("dur=\"20.000s\"").count(), 4);
        assert!(film.len() < 150_000, "{} bytes", film.len());
    }

    #[test]
    fn the_last_frame_stands_where_nothing_moves() {
        let film = animation(&acrobot(3, 0.5)).unwrap();
        let mut paths = film.split("<path");
        let bars = paths
            .find(|path| path.contains("attributeName=\"d\""))
            .unwrap();
        let attribute = |name: &str| {
            let after = bars.split(&format!(" {name}=\"")).nth(1).unwrap();
            after.split('"').next().unwrap()
        };
        let last = attribute("values").split(';').next_back();
        assert_eq!(last, Some(attribute("d")));
    }

    #[test]
    fn all_that_moves_shares_one_clock() {
        let mut episode = acrobot(5, 0.1);
        episode.strips.clear();
        let film = animation(&episode).unwrap();
        assert_eq!(film.matches("<svg").count(), 1, "{film}");
    }

    #[test]
    fn frames_between_frames_are_straight() {
        let frames: Vec<_> = (0..4).map(|k| vec![[f64::from(k), 0.0]]).collect();
        let shown: Vec<f64> = resampled(&frames, 3)
            .iter()
            .map(|points| points[0].0)
            .collect();
        assert_eq!(shown, [0.0, 1.5, 3.0]);
    }

    #[test]
    fn a_metre_is_as_long_across_as_up() {
        let mut episode = acrobot(2, 1.0);
        episode.chains[0].frames = vec![vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]; 2];
        let film = animation(&episode).unwrap();
        let data = film
            .split("values=\"")
            .nth(2)
            .unwrap()
            .split(';')
            .next()
            .unwrap();
        let numbers: Vec<f64> = data
            .split(['M', 'L', ' '])
            .filter_map(|number| number.parse().ok())
            .collect();
        let (across, up) = (numbers[2] - numbers[0], numbers[3] - numbers[5]);
        assert!((across - up).abs() < 0.2 && across > 100.0, "{across} {up}");
    }

    #[test]
    fn lengths_add_up() {
        assert_eq!(
            lengths_along(&[(0.0, 0.0), (3.0, 4.0), (3.0, 5.0)]),
            [0.0, 5.0, 6.0]
        );
    }

    #[test]
    fn a_motion_that_diverges_ends_there() {
        let mut episode = acrobot(11, 0.1);
        episode.chains[0].frames[6][2][0] = f64::NAN;
        let film = animation(&episode).unwrap();
        assert_eq!(keyframes(&film), [6, 6, 6]);
        assert!(film.contains("not finite after 0.50 s") && !film.contains("NaN"));
    }

    #[test]
    fn odd_episodes_are_drawn() {
        let single = acrobot(1, 0.02);
        let mut bare = acrobot(5, 0.02);
        bare.strips.clear();
        let mut unknown = acrobot(5, 0.02);
        unknown.strips[0].lines[0].values.fill(f64::NAN);
        let mut still = acrobot(5, 0.02);
        still.chains[0].frames = vec![vec![[0.0, 0.0]]; 5];
        for episode in [single, bare, unknown, still] {
            let film = animation(&episode).unwrap();
            assert!(!film.contains("NaN") && !film.contains("inf\""), "{film}");
        }
    }

    #[test]
    fn nothing_to_show_and_uneven_chains_are_errors() {
        let mut empty = acrobot(5, 0.02);
        empty.chains.clear();
        assert!(matches!(animation(&empty), Err(PlotError::Empty { .. })));
        let mut uneven = acrobot(5, 0.02);
        uneven.chains[0].frames[3].pop();
        assert!(matches!(
            animation(&uneven),
            Err(PlotError::Uneven { chain: 1, .. })
        ));
        let mut short = acrobot(5, 0.02);
        let frames = short.chains[0].frames[..4].to_vec();
        short.chains.push(Chain { frames });
        assert!(matches!(
            animation(&short),
            Err(PlotError::Uneven { chain: 2, .. })
        ));
    }
}
