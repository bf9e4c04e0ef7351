//! The links of a mechanism, seen from the side that shows most of their motion.

use nalgebra::{Matrix3, Vector3};

use super::Tracks;
use super::sketch::{PictureEntry, Point, Sketch};
use crate::plot_data::span;
use residyn_core::closeloop::Outcome;
use residyn_core::decomposition::eigen;
use residyn_core::model::tree::{Joint, Pose, recover};

/// Half the length of the line that stands for the base, as a share of the mechanism.
const BASE: f64 = 0.12;
/// A mechanism is seen from above if its line of sight is this near to the vertical (cosine).
const STEEP: f64 = 0.95;
/// Links that reach less far than this (m) are drawn as joints.
const SHORTEST: f64 = 1e-3;

/// How the mechanism is drawn, and its picture; none if its links are not known.
pub(super) fn drawn(
    outcome: &Outcome,
    tracks: &Tracks,
) -> Option<(&'static str, Vec<PictureEntry>)> {
    let (words, links) = links(outcome)?;
    let seen: Vec<Vec<Vector3<f64>>> = tracks[0].iter().map(|q| points(&links, q)).collect();
    let [right, up] = view(&seen);
    let flat = |point: &Vector3<f64>| [point.dot(&right), point.dot(&up)];
    let spans = [0, 1].map(|k| span(seen.iter().flatten().map(|point| flat(point)[k])));
    let [[leftmost, rightmost], [lowest, highest]] = spans;
    let half = BASE * (rightmost - leftmost).max(highest - lowest);
    let sketch = Sketch {
        about: "the mechanism".to_owned(),
        low: [leftmost.min(-half), lowest.min(0.0)],
        high: [rightmost.max(half), highest.max(0.0)],
        ground: vec![[-half, 0.0], [half, 0.0]],
        line: |q: &[f64]| -> Vec<Point> { points(&links, q).iter().map(flat).collect() },
    };
    (half > SHORTEST).then(|| (words, vec![sketch.moved(tracks)]))
}

/// The links as the model file describes them, or those of a mechanism with the fitted equations.
fn links(outcome: &Outcome) -> Option<(&'static str, Vec<Joint>)> {
    let fitted = &outcome.models.after.model;
    if let Some(described) = fitted.mechanism(&outcome.given.declared) {
        let words = "The links are drawn as the model file describes them, to the centre of mass of the last body.";
        return Some((words, described.joints));
    }
    // A mechanism that only slides has nothing to show.
    let turns = fitted.prismatic.contains(&false);
    let bare = fitted.absorbed().without_drive().with_effects(Vec::new());
    let found = turns.then(|| recover(&bare.dynamics(), &bare.prismatic).ok())?;
    let words = "The links are those of a mechanism with the fitted equations; lengths that they do not determine are assumed.";
    Some((words, found?.joints))
}

/// The base if the first joint turns on it, the joints, and the centre of mass of the last body, m.
fn points(links: &[Joint], q: &[f64]) -> Vec<Vector3<f64>> {
    let mut own = q.iter();
    let mut coordinates: Vec<f64> = Vec::with_capacity(links.len());
    let mut frame = Pose::identity();
    let mut points = Vec::with_capacity(links.len() + 2);
    if links.first().is_some_and(|first| !first.slides) {
        points.push(frame.origin);
    }
    for link in links {
        let coordinate = match link.follows {
            Some(follows) => follows.ratio * coordinates[follows.leader] + follows.offset,
            None => own.next().copied().unwrap_or_default(),
        };
        coordinates.push(coordinate);
        frame = frame.then(&link.at(coordinate));
        points.push(frame.origin);
    }
    if let Some(body) = links.last().map(|link| link.inertia)
        && body.mass > 0.0
    {
        points.push(frame.rotation * body.moment / body.mass + frame.origin);
    }
    points
}

/// The directions to the right and upwards when points are viewed along the direction in which they spread least.
fn view(seen: &[Vec<Vector3<f64>>]) -> [Vector3<f64>; 2] {
    let all = || seen.iter().flatten();
    #[allow(clippy::cast_precision_loss)] // thousands of points
    let count = all().count().max(1) as f64;
    let middle = all().sum::<Vector3<f64>>() / count;
    let products = all().map(|point| (point - middle) * (point - middle).transpose());
    let Some(axes) = eigen(products.sum::<Matrix3<f64>>()) else {
        return [Vector3::x(), Vector3::y()];
    };
    let sight: Vector3<f64> = axes.eigenvectors.column(axes.eigenvalues.imin()).into();
    if sight.z.abs() > STEEP {
        return [Vector3::x(), Vector3::y()];
    }
    let right = Vector3::z().cross(&sight).normalize();
    let up = (Vector3::z() - sight * sight.z).normalize();
    [right * right[right.iamax()].signum(), up]
}
