//! Draws an episode as an animation.

use svg::node::element::{Animate, Group, Path};

use super::strips::{STRIP_HEIGHT, Strip, clock_value, draw_strips, entries, numbered, strip_axis};
use crate::PlotError;
use crate::axes::{Axis, FOOT, Frame, HEAD, remark};
use crate::canvas::{Area, curves, dots, dots_data, line_data, px};
use crate::legend::with_key;
use crate::scale::Range;
use crate::style::{MARGIN, Stroke, WIDTH};

/// The eye gains nothing from more frames than this.
const FRAMES_PER_S: f64 = 25.0;
const STAGE_HEIGHT: f64 = 400.0;
const LINK_PX: f64 = 10.0;
const JOINT_PX: f64 = 5.0;
/// Enough of the tip's path to show where it comes from, without the tangle of all earlier motion.
const TAIL_PX: f64 = 400.0;

/// An episode of a mechanism in a plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Animation {
    pub title: String,
    /// Time from one frame to the next in s.
    pub step_s: f64,
    /// The bodies, at least one, all with the same number of frames. The last point of the last body leaves a trace.
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

/// A part of an episode as it is shown: evenly spaced frames, the first at time 0.
struct Motion {
    duration_s: f64,
    /// `[chain][frame][point]` in m.
    chains: Vec<Vec<Vec<(f64, f64)>>>,
}

/// Draws a film: one SVG document that plays an episode in real time and in an endless loop wherever SVG animations are
/// played, and shows its last frame elsewhere.
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
    let bottom = draw_strips(
        &mut canvas,
        &episode.strips,
        episode.step_s,
        &strip_axes,
        motion.duration_s,
        area,
    );
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

/// When the motion ends, if that is before the end of the episode.
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
        // The numbers hardly change their width when the range is widened to the shape of the area.
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

/// The values of an attribute at evenly spaced times, repeated without end.
fn animated(attribute: &str, values: &[String], duration_s: f64) -> Animate {
    Animate::new()
        .set("attributeName", attribute)
        .set("values", values.join(";"))
        .set("dur", clock_value(duration_s))
        .set("repeatCount", "indefinite")
}

#[cfg(test)]
mod tests;
