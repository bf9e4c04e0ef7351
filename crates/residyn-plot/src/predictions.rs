//! The figure of a model's predictions against the measured motion.

use super::PlotError;
use super::axes::{Axis, FOOT, Frame, HEAD, Quantity, heading};
use super::canvas::{Area, Canvas, clipped, curves, marker};
use super::decimate::{decimate, drawable_pieces};
use super::legend::{Entry, Sample, begin};
use super::scale::Range;
use super::style::{INK, MARGIN, Role, START_MARK_PX, WIDTH};

/// About two points for each column of pixels: more cannot be seen.
const MAX_TRACK_POINTS: usize = 4000;
/// With more pieces, the marks at their starts would hide the curves.
const MAX_START_MARKS: usize = 60;
/// The axis extends at least this far (rad or m) beyond the measured range, so that the noise of a rig at rest does not
/// fill the panel.
const LEAST_REACH: f64 = 0.1;

/// A curve of one joint, in one or more pieces.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// Name in the legend.
    pub label: String,
    /// What the curve shows.
    pub role: Role,
    /// Time in s and the panel's quantity, piece by piece. A prediction that is restarted from the log has a piece
    /// for each start.
    pub segments: Vec<Vec<(f64, f64)>>,
}

/// The curves of one joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// The joint for people, as in `2 (elbow)`.
    pub label: String,
    /// What its curves show.
    pub quantity: Quantity,
    /// Its curves, in any order.
    pub tracks: Vec<Track>,
}

/// Draws one panel per joint, stacked over a common time axis.
///
/// A prediction that runs away does not squeeze the others: the axis ends one measured range beyond the measured
/// range, and a remark counts the points that lie outside. Points that are not finite leave a gap and are counted
/// there too. Long curves are thinned to what can be seen, spikes kept.
pub fn predictions(panels: &[Panel], title: &str) -> Result<String, PlotError> {
    let (mut canvas, mut top) = begin(title, panels, entries)?;
    let height = match panels.len() {
        1 => 330.0,
        2 => 220.0,
        _ => 170.0,
    };
    let vertical: Vec<Axis> = panels.iter().map(|panel| y_axis(panel, height)).collect();
    let left = MARGIN + vertical.iter().map(Axis::gutter).fold(0.0, f64::max);
    let width = WIDTH - left - MARGIN;
    let horizontal = Axis::horizontal(time_range(panels), width, &Quantity::new("time", "s"));
    for (index, (panel, y)) in panels.iter().zip(&vertical).enumerate() {
        let area = Area {
            x: left,
            y: top + HEAD,
            width,
            height,
        };
        let frame = Frame {
            area,
            x: &horizontal,
            y,
        };
        draw_panel(&mut canvas, &frame, panel);
        if index + 1 == panels.len() {
            canvas.add(frame.x_labels());
        }
        top = area.bottom() + 4.0;
    }
    Ok(canvas.finish(top + FOOT))
}

fn time_range(panels: &[Panel]) -> Range {
    let times = panels.iter().flat_map(points).map(|point| point.0);
    Range::spanning(times)
        .unwrap_or(Range { lo: 0.0, hi: 1.0 })
        .drawable()
}

fn points(panel: &Panel) -> impl Iterator<Item = (f64, f64)> {
    panel.tracks.iter().flat_map(track_points)
}

fn track_points(track: &Track) -> impl Iterator<Item = (f64, f64)> {
    track.segments.iter().flatten().copied()
}

fn entries(panels: &[Panel]) -> Vec<Entry> {
    let mut tracks: Vec<&Track> = panels.iter().flat_map(|panel| &panel.tracks).collect();
    tracks.sort_by_key(|track| track.role);
    let line = |track: &&Track| Entry::new(Sample::Line(track.role.stroke()), &track.label);
    let mut entries: Vec<Entry> = tracks.iter().map(line).collect();
    if tracks.iter().any(|track| has_start_marks(track)) {
        entries.push(Entry::new(Sample::Start, "restart"));
    }
    entries
}

fn has_start_marks(track: &Track) -> bool {
    track.role != Role::Measured && (2..=MAX_START_MARKS).contains(&track.segments.len())
}

fn y_axis(panel: &Panel, pixels: f64) -> Axis {
    let heights = |tracks: &mut dyn Iterator<Item = &Track>| {
        Range::spanning(tracks.flat_map(track_points).map(|point| point.1))
    };
    let all = heights(&mut panel.tracks.iter());
    let measured = heights(
        &mut panel
            .tracks
            .iter()
            .filter(|track| track.role == Role::Measured),
    );
    let range = match (all, measured) {
        (Some(all), Some(measured)) => {
            let reach = measured.width().max(LEAST_REACH);
            all.intersection(Range {
                lo: measured.lo - reach,
                hi: measured.hi + reach,
            })
        }
        (Some(all), None) => all,
        (None, _) => Range { lo: -1.0, hi: 1.0 },
    };
    Axis::vertical(range.drawable().widened(0.04), pixels, &panel.quantity)
}

fn draw_panel(canvas: &mut Canvas, frame: &Frame, panel: &Panel) {
    canvas.add(frame.grid());
    canvas.add(frame.y_labels());
    canvas.add(heading(frame.area, &format!("Joint {}", panel.label)));
    let mut tracks: Vec<&Track> = panel.tracks.iter().collect();
    tracks.sort_by_key(|track| track.role);
    let mut inner = clipped(frame.area);
    let mut starts = Vec::new();
    for track in tracks {
        let lines = visible_lines(track, frame);
        inner = inner.add(curves(
            lines.iter().map(Vec::as_slice),
            &track.role.stroke(),
        ));
        if has_start_marks(track) {
            starts.extend(lines.iter().filter_map(|line| line.first().copied()));
        }
    }
    for start in starts {
        inner = inner.add(marker(start, START_MARK_PX, INK));
    }
    canvas.add(inner);
    let how = "points lie outside or are not finite";
    if let Some(remark) = frame.hidden(points(panel), how) {
        canvas.add(remark);
    }
}

/// The pieces of a curve in pixels, thinned, and split where a point is not finite.
fn visible_lines(track: &Track, frame: &Frame) -> Vec<Vec<(f64, f64)>> {
    let total = track_points(track).count().max(1);
    let pieces = track
        .segments
        .iter()
        .flat_map(|segment| drawable_pieces(segment));
    pieces
        .map(|piece| {
            let share = MAX_TRACK_POINTS * piece.len() / total;
            let kept = decimate(piece, share);
            kept.into_iter()
                .map(|point| frame.point_px(point))
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{Panel, Track, predictions};
    use crate::{Quantity, Role};

    fn panel(role: Role, points: Vec<(f64, f64)>) -> Panel {
        let label = format!("{role:?}");
        let segments = vec![points];
        let tracks = vec![Track {
            label,
            role,
            segments,
        }];
        Panel {
            label: "1".into(),
            quantity: Quantity::new("position q1", "rad"),
            tracks,
        }
    }

    #[test]
    fn degenerate_data_are_drawn() {
        let cases = [
            vec![],
            vec![(0.0, 1.0)],
            vec![(0.0, 2.0), (1.0, 2.0)],
            vec![(0.0, f64::NAN), (1.0, f64::INFINITY)],
            vec![(0.0, -1e308), (1.0, 1e308)],
        ];
        for points in cases {
            let figure = predictions(&[panel(Role::Measured, points)], "odd").unwrap();
            assert!(
                !figure.contains("NaN") && !figure.contains("inf\""),
                "{figure}"
            );
        }
    }

    #[test]
    fn a_long_log_stays_small_and_keeps_its_spike() {
        let points = (0..1_000_000).map(|i| (f64::from(i), if i == 500_001 { 5.0 } else { 0.0 }));
        let figure = predictions(&[panel(Role::Measured, points.collect())], "long").unwrap();
        assert!(figure.matches('L').count() <= 4000);
        assert!(figure.len() < 100_000);
    }

    #[test]
    fn a_runaway_prediction_is_cut_and_counted() {
        let mut both = panel(Role::Measured, vec![(0.0, 0.0), (1.0, 1.0)]);
        both.tracks
            .extend(panel(Role::Before, vec![(0.0, 0.0), (1.0, 1e6)]).tracks);
        let figure = predictions(&[both], "runaway").unwrap();
        assert!(figure.contains("1 of 4 points lie outside"));
    }
}
