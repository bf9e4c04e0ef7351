//! The mechanism behind equations, where it is one of a few: a joint alone, two that turn in one plane, a pendulum on a
//! slide. Masses and lengths are such that the motion is the same; the motion does not tell them all.

use nalgebra::{Complex, DMatrix, DVector, Matrix3, Vector3};

use super::body::{Drivetrain, Joint};
use super::series::Series;
use super::spatial::{turn, with_z_along};
use super::{Inertia, Pose};
use crate::model::Dynamics;

/// A point or a vector of the plane in which links turn: z (up), and i times x. Turning by q about y multiplies by
/// exp(iq).
type Planar = Complex<f64>;

/// A mechanism with the same equations of motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Recovered {
    pub joints: Vec<Joint>,
    /// m/s^2
    pub gravity: f64,
}

/// How far the equations may be from those of a mechanism, relative to the largest value of each entry.
const SAME: f64 = 1e-9;
/// Below this share of what it is added to, a number is rounding.
const ROUNDING: f64 = 1e-10;
/// Where the motion does not tell a body's mass: m from its axis.
const GYRATION: f64 = 0.1;
/// Where the equations do not tell gravity: m/s^2.
const GRAVITY: f64 = 9.81;

/// The mechanism of equations without effects; `prismatic` says which joints slide.
///
/// Links hang on their joints in the frame of the world at q = 0: joints that turn do so about y, joints that slide
/// along a horizontal or an inclined x, and gravity acts against z.
///
/// # Errors
/// Equations that are not those of such a mechanism, or of one that no bodies make up.
pub fn recover(declared: &Dynamics, prismatic: &[bool]) -> Result<Recovered, String> {
    let shape = match prismatic {
        [false] => Shape::turning(),
        [true] => Shape::sliding(),
        [false, false] => Shape::arm(),
        [true, false] => Shape::on_a_slide(),
        _ => return Err(KNOWN.to_owned()),
    };
    let found = shape.fit(declared)?;
    let gravity = gravity(declared);
    let (mut joints, downward) = match prismatic {
        [false] => turning(&found, gravity)?,
        [true] => sliding(&found, gravity)?,
        [false, false] => arm(&found, gravity)?,
        _ => on_a_slide(&found, gravity)?,
    };
    let largest = found.iter().map(|x| x.abs()).fold(0.0, f64::max);
    for (joint, damping) in joints.iter_mut().zip(shape.damping(&found)) {
        if *damping < -ROUNDING * largest {
            return Err(format!("{} is driven by its own speed", joint.name));
        }
        joint.drivetrain.damping = if *damping > ROUNDING * largest {
            *damping
        } else {
            0.0
        };
    }
    Ok(upright(joints, downward))
}

const KNOWN: &str = "it is none of the mechanisms that are known: one joint, two that turn in one plane, one that turns on one that slides";

/// The model's gravity where it has one, m/s^2.
fn gravity(declared: &Dynamics) -> f64 {
    let mut parameters = declared.parameters.iter();
    let own = parameters.find(|p| p.unit == "m/s^2" && p.value > 0.0);
    own.map_or(GRAVITY, |p| p.value)
}

/// What equations of one kind are sums of.
struct Shape {
    joints: usize,
    parts: Vec<Part>,
}

/// What one number adds to the equations.
enum Part {
    /// To entries of the mass matrix: row, column, function.
    Mass(Vec<(usize, usize, Series)>),
    /// To the forces that joints need at rest.
    Force(Vec<(usize, Series)>),
    /// To the force that a joint needs per speed.
    Damping(usize),
}

impl Shape {
    fn turning() -> Self {
        let one = || Series::constant(1.0);
        let mut parts = vec![Part::Mass(vec![(0, 0, one())])];
        parts.extend(waves(&[0]).map(|wave| Part::Force(vec![(0, wave)])));
        Self::new(1, parts)
    }

    fn sliding() -> Self {
        let one = || Series::constant(1.0);
        let parts = vec![
            Part::Mass(vec![(0, 0, one())]),
            Part::Force(vec![(0, one())]),
        ];
        Self::new(1, parts)
    }

    /// Inertia beyond the second joint, coupling (two), inertia of the whole, rotor of the second joint, weight of the
    /// whole and of the second link.
    fn arm() -> Self {
        let one = || Series::constant(1.0);
        let mut parts = vec![Part::Mass(vec![(0, 0, one())])];
        let coupling = |wave: Series| vec![(0, 0, &wave * 2.0), (0, 1, wave)];
        parts.extend(waves(&[1]).map(|wave| Part::Mass(coupling(wave))));
        parts.push(Part::Mass(vec![
            (0, 0, one()),
            (0, 1, one()),
            (1, 1, one()),
        ]));
        parts.push(Part::Mass(vec![(1, 1, one())]));
        parts.extend(waves(&[0]).map(|wave| Part::Force(vec![(0, wave)])));
        let both = |wave: Series| vec![(0, wave.clone()), (1, wave)];
        parts.extend(waves(&[0, 1]).map(|wave| Part::Force(both(wave))));
        Self::new(2, parts)
    }

    fn on_a_slide() -> Self {
        let one = || Series::constant(1.0);
        let mut parts = vec![Part::Mass(vec![(0, 0, one())])];
        parts.extend(waves(&[1]).map(|wave| Part::Mass(vec![(0, 1, wave)])));
        parts.push(Part::Mass(vec![(1, 1, one())]));
        parts.push(Part::Force(vec![(0, one())]));
        parts.extend(waves(&[1]).map(|wave| Part::Force(vec![(1, wave)])));
        Self::new(2, parts)
    }

    fn new(joints: usize, mut parts: Vec<Part>) -> Self {
        parts.extend((0..joints).map(Part::Damping));
        Self { joints, parts }
    }

    /// The damping of each joint, among what was found.
    fn damping<'f>(&self, found: &'f [f64]) -> &'f [f64] {
        &found[found.len() - self.joints..]
    }

    /// The number of each part, by least squares on points all over the space of states.
    fn fit(&self, declared: &Dynamics) -> Result<Vec<f64>, String> {
        let n = self.joints;
        let (mut rows, mut wanted) = (Vec::new(), Vec::new());
        for (q, qd) in states(n) {
            let (mass, force) = inverse_dynamics(declared, &q, &qd).ok_or(KNOWN)?;
            let columns: Vec<_> = self.parts.iter().map(|part| part.at(n, &q, &qd)).collect();
            rows.push(DMatrix::from_columns(&columns));
            wanted.push(stacked(&mass, &force));
        }
        let sizes = sizes(&wanted);
        let scaled = |mut matrix: DMatrix<f64>| {
            for (mut row, size) in matrix.row_iter_mut().zip(&sizes) {
                row /= *size;
            }
            matrix
        };
        let entries = sizes.len();
        let mut left = DMatrix::zeros(entries * rows.len(), self.parts.len());
        let mut right = DVector::zeros(entries * rows.len());
        for (k, (row, wanted)) in rows.into_iter().zip(&wanted).enumerate() {
            left.rows_mut(k * entries, entries).copy_from(&scaled(row));
            let column = DMatrix::from_column_slice(entries, 1, wanted.as_slice());
            right
                .rows_mut(k * entries, entries)
                .copy_from(&scaled(column));
        }
        let svd = left.clone().svd(true, true);
        let found = svd
            .solve(&right, 1e-12)
            .expect("both factors were asked for");
        let off = (&left * &found - &right).amax();
        if off > SAME {
            return Err(format!(
                "{KNOWN} (off by {off:.1e} of the largest torque or inertia)"
            ));
        }
        Ok(found.iter().copied().collect())
    }
}

/// cos and sin of the sum of these joints' angles.
fn waves(joints: &[usize]) -> impl Iterator<Item = Series> {
    let start = (Series::constant(1.0), Series::default());
    let (cos, sin) = joints.iter().fold(start, |(c, s), joint| {
        let (c_j, s_j) = (Series::cos(*joint), Series::sin(*joint));
        (&(&c * &c_j) - &(&s * &s_j), &(&s * &c_j) + &(&c * &s_j))
    });
    [cos, sin].into_iter()
}

impl Part {
    /// What a unit adds to the entries of the mass matrix and to the forces at a state.
    fn at(&self, n: usize, q: &[f64], qd: &[f64]) -> DVector<f64> {
        let (mut mass, mut force) = (DMatrix::zeros(n, n), DVector::zeros(n));
        match self {
            Self::Mass(entries) => {
                for (i, j, series) in entries {
                    mass[(*i, *j)] += series.value(q);
                    if i != j {
                        mass[(*j, *i)] += series.value(q);
                    }
                    add_coriolis(&mut force, (*i, *j), series, q, qd);
                }
            }
            Self::Force(entries) => {
                entries
                    .iter()
                    .for_each(|(i, series)| force[*i] += series.value(q));
            }
            Self::Damping(joint) => force[*joint] += qd[*joint],
        }
        stacked(&mass, &force)
    }
}

/// The derivative of M qd by the way, less half the gradient of qd M qd, for one entry of M and its mirror image.
fn add_coriolis(
    force: &mut DVector<f64>,
    (i, j): (usize, usize),
    series: &Series,
    q: &[f64],
    qd: &[f64],
) {
    let slopes: Vec<f64> = (0..q.len())
        .map(|k| series.derivative(k).value(q))
        .collect();
    let rate: f64 = slopes.iter().zip(qd).map(|(slope, qd)| slope * qd).sum();
    let twice = if i == j { 1.0 } else { 2.0 };
    force[i] += rate * qd[j];
    if i != j {
        force[j] += rate * qd[i];
    }
    for (force, slope) in force.iter_mut().zip(slopes) {
        *force -= 0.5 * twice * slope * qd[i] * qd[j];
    }
}

/// States that no symmetry holds together, 0 among them.
fn states(n: usize) -> Vec<(Vec<f64>, Vec<f64>)> {
    let mut states = vec![(vec![0.0; n], vec![0.0; n])];
    // Multiples of irrational numbers fill the space evenly.
    let spread =
        |k: usize, root: f64, reach: f64| reach * (2.0 * (k as f64 * root.sqrt()).fract() - 1.0);
    for k in 1..60 {
        let of = |roots: [f64; 2], reach| {
            roots[..n]
                .iter()
                .map(|root| spread(k, *root, reach))
                .collect()
        };
        states.push((of([2.0, 3.0], 3.0), of([5.0, 7.0], 4.0)));
    }
    states
}

/// Mass matrix, and the force that holds the accelerations at zero; none where a torque moves nothing.
fn inverse_dynamics(
    declared: &Dynamics,
    q: &[f64],
    qd: &[f64],
) -> Option<(DMatrix<f64>, DVector<f64>)> {
    let n = declared.joints;
    let values = declared.values();
    let accelerations = |tau: &DVector<f64>| {
        let inputs = [q, qd, tau.as_slice(), &[0.0], &values].concat();
        DVector::from_column_slice(&declared.program.eval(&inputs)[n..])
    };
    let free = accelerations(&DVector::zeros(n));
    let unit = |j: usize| DVector::from_fn(n, |i, _| if i == j { 1.0 } else { 0.0 });
    let columns: Vec<_> = (0..n).map(|j| accelerations(&unit(j)) - &free).collect();
    let mass = DMatrix::from_columns(&columns).try_inverse()?;
    let force = -(&mass * free);
    (mass.iter().chain(&force).all(|x| x.is_finite())).then_some((mass, force))
}

fn stacked(mass: &DMatrix<f64>, force: &DVector<f64>) -> DVector<f64> {
    DVector::from_iterator(mass.len() + force.len(), mass.iter().chain(force).copied())
}

/// The largest magnitude of each entry; of the forces one for all, so that none is measured by its own rounding.
fn sizes(rows: &[DVector<f64>]) -> Vec<f64> {
    let entries = rows[0].len();
    let largest = (0..entries).map(|k| rows.iter().map(|row| row[k].abs()).fold(0.0, f64::max));
    let largest: Vec<f64> = largest.collect();
    let overall = largest.iter().copied().fold(0.0, f64::max);
    largest
        .into_iter()
        .map(|size| {
            if size > ROUNDING * overall {
                size
            } else {
                overall
            }
        })
        .collect()
}

/// Joints, and gravity as a vector of the plane.
type Links = (Vec<Joint>, Planar);

fn turning(found: &[f64], gravity: f64) -> Result<Links, String> {
    let [inertia, cos, sin, ..] = found[..] else {
        unreachable!("the shape has these")
    };
    let moment = weight(cos, sin, gravity);
    let link = link(inertia, moment, likely_mass(inertia, moment))?;
    Ok((
        vec![joint(1, Planar::new(0.0, 0.0), link)],
        Planar::new(-gravity, 0.0),
    ))
}

fn sliding(found: &[f64], gravity: f64) -> Result<Links, String> {
    let [mass, force, ..] = found[..] else {
        unreachable!("the shape has these")
    };
    Ok((vec![slide(mass)?], inclined(mass, force, gravity)))
}

/// Gravity for a slide along x that needs a force at rest.
fn inclined(mass: f64, force: f64, gravity: f64) -> Planar {
    let along = -force / mass;
    let across = (gravity.powi(2) - along.powi(2)).max(0.0).sqrt();
    Planar::new(
        -across,
        if along.abs() > ROUNDING * gravity {
            along
        } else {
            0.0
        },
    )
}

fn arm(found: &[f64], gravity: f64) -> Result<Links, String> {
    let [first, c, s, second, rotor, cos_1, sin_1, cos_2, sin_2, ..] = found[..] else {
        unreachable!("the shape has these")
    };
    // Length to the second joint, conjugate, times the moment of the second link.
    let coupling = Planar::new(c, -s);
    let (moment_1, moment_2) = (weight(cos_1, sin_1, gravity), weight(cos_2, sin_2, gravity));
    let weighs = |moment: Planar, inertia: f64| moment.norm() > ROUNDING * inertia;
    let (elbow, moment_2, downward) = if weighs(moment_2, second) {
        (clean((coupling / moment_2).conj()), moment_2, gravity)
    } else if weighs(moment_1, first) && weighs(coupling, second) {
        return Err("gravity acts on the first link alone".into());
    } else {
        // Without weight any length will do.
        let downward = if weighs(moment_1, first) {
            gravity
        } else {
            0.0
        };
        (Planar::new(1.0, 0.0), clean(coupling), downward)
    };
    let most = first / elbow.norm_sqr();
    let mass_2 = mass_between(moment_2.norm_sqr() / second, most);
    let own = first - mass_2 * elbow.norm_sqr();
    let moment_1 = moment_1 - elbow * mass_2;
    if rotor < -ROUNDING * second {
        return Err("the second joint has less inertia for itself than for the first".into());
    }
    let mut outer = joint(2, elbow, link(second, moment_2, mass_2)?);
    outer.drivetrain.armature = if rotor > ROUNDING * second {
        rotor
    } else {
        0.0
    };
    let inner = joint(
        1,
        Planar::new(0.0, 0.0),
        link(own, moment_1, likely_mass(own, moment_1))?,
    );
    Ok((vec![inner, outer], Planar::new(-downward, 0.0)))
}

fn on_a_slide(found: &[f64], gravity: f64) -> Result<Links, String> {
    let [mass, c, s, inertia, force, cos, sin, ..] = found[..] else {
        unreachable!("the shape has these")
    };
    let moment = clean(Planar::new(c, -s));
    let pull = Planar::new(sin, cos);
    let downward = if moment.norm() > ROUNDING * (mass * inertia).sqrt() {
        near(-gravity, (pull / moment).conj())
    } else {
        inclined(mass, force, gravity)
    };
    if (force + mass * downward.im).abs() > SAME * mass * gravity.max(downward.norm()) {
        return Err("the force along the slide is not that of gravity on the pendulum".into());
    }
    let pole = mass_between(moment.norm_sqr() / inertia, mass);
    let turning = joint(2, Planar::new(0.0, 0.0), link(inertia, moment, pole)?);
    Ok((vec![slide(mass - pole)?, turning], downward))
}

/// Mass times centre of mass, of the torque cos * cos q + sin * sin q that gravity asks for.
fn weight(cos: f64, sin: f64, gravity: f64) -> Planar {
    clean(Planar::new(-sin / gravity, -cos / gravity))
}

/// Without a part that is rounding of the other.
fn clean(found: Planar) -> Planar {
    let part = |part: f64| {
        if part.abs() > ROUNDING * found.norm() {
            part
        } else {
            0.0
        }
    };
    Planar::new(part(found.re), part(found.im))
}

/// What was found, unless it is the expected but for rounding.
fn near(expected: f64, found: Planar) -> Planar {
    let expected = Planar::new(expected, 0.0);
    if (found - expected).norm() < SAME * expected.norm() {
        expected
    } else {
        found
    }
}

/// Halfway between the least mass that the second moment allows and the most that the first link does.
fn mass_between(least: f64, most: f64) -> f64 {
    if least > ROUNDING * most {
        (least * most).sqrt()
    } else {
        0.5 * most
    }
}

/// Half of the inertia due to the distance of the mass.
fn likely_mass(inertia: f64, moment: Planar) -> f64 {
    let mass = 2.0 * moment.norm_sqr() / inertia;
    if mass > ROUNDING * inertia {
        mass
    } else {
        inertia / GYRATION.powi(2)
    }
}

/// A link in its joint's frame; about its centre of mass all axes are alike.
fn link(inertia: f64, moment: Planar, mass: f64) -> Result<Inertia, String> {
    let own = inertia - moment.norm_sqr() / mass;
    if !(mass > 0.0 && own > 0.0) {
        return Err("no bodies have such inertia".into());
    }
    let at = Pose {
        rotation: Matrix3::identity(),
        origin: in_frame(moment / mass),
    };
    Ok(Inertia::central(mass, Matrix3::identity() * own, &at))
}

/// A vector of the plane in the frame of a joint about y.
fn in_frame(planar: Planar) -> Vector3<f64> {
    Vector3::new(planar.re, planar.im, 0.0)
}

/// A joint about y at a point of the plane, seen from the world.
fn joint(number: usize, at: Planar, inertia: Inertia) -> Joint {
    plain(
        number,
        Vector3::y(),
        Vector3::new(at.im, 0.0, at.re),
        inertia,
    )
}

/// A joint along x, seen from the world.
fn slide(mass: f64) -> Result<Joint, String> {
    if mass <= 0.0 {
        return Err("no bodies have such inertia".into());
    }
    let own = Matrix3::identity() * (mass * GYRATION.powi(2));
    let inertia = Inertia::central(mass, own, &Pose::identity());
    let slide = plain(1, Vector3::x(), Vector3::zeros(), inertia);
    Ok(Joint {
        slides: true,
        ..slide
    })
}

/// A joint with nothing but inertia, its body in the axes of the world.
fn plain(number: usize, axis: Vector3<f64>, origin: Vector3<f64>, inertia: Inertia) -> Joint {
    let rotation = with_z_along(axis);
    Joint {
        name: format!("joint{number}"),
        body: format!("link{number}"),
        slides: false,
        pose: Pose { rotation, origin },
        reference: 0.0,
        across: rotation.column(0).into(),
        axis,
        inertia,
        drivetrain: Drivetrain::default(),
    }
}

/// Joints in the world as joints in a chain, turned so that gravity acts against z.
fn upright(mut joints: Vec<Joint>, downward: Planar) -> Recovered {
    let level = Pose {
        rotation: turn(Vector3::y(), (-downward.conj()).arg()),
        origin: Vector3::zeros(),
    };
    let mut inner = level.inverse();
    for joint in &mut joints {
        let outer = joint.pose;
        joint.pose = inner.inverse().then(&outer);
        inner = outer;
    }
    Recovered {
        joints,
        gravity: downward.norm(),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::recover;
    use crate::expr::SignForm;
    use crate::model::{Library, System};

    fn recovered(system: &System) -> Result<super::Recovered, String> {
        let declared = system.dynamics_with(&[], &vec![SignForm::DEFAULT; system.joints]);
        recover(&declared, &system.prismatic)
    }

    fn built_in(name: &str) -> super::Recovered {
        recovered(&Library::built_in().system(Path::new(name)).unwrap()).unwrap()
    }

    #[test]
    fn the_acrobots_elbow_is_a_link_away() {
        let acrobot = built_in("acrobot");
        let elbow = acrobot.joints[1].pose.origin;
        assert!((elbow.norm() - 1.0).abs() < 1e-12, "{elbow}");
        assert!((acrobot.gravity - 9.8).abs() < 1e-12);
        let moment = acrobot.joints[1].inertia.moment;
        assert!((moment.norm() - 0.5).abs() < 1e-12, "{moment}");
    }

    #[test]
    fn the_cartpoles_gravity_is_that_of_its_file() {
        let cartpole = built_in("cartpole");
        assert_eq!(cartpole.gravity, 9.81);
        let whole: f64 = cartpole.joints.iter().map(|joint| joint.inertia.mass).sum();
        assert!((whole - 1.1).abs() < 1e-12);
    }

    #[test]
    fn equations_of_no_mechanism_are_refused() {
        for (bias, said) in [
            ("q1^3", "none of the mechanisms"),
            ("sin(2*q1)", "none of the mechanisms"),
            ("tanh(qd1)", "none of the mechanisms"),
            ("-qd1", "driven by its own speed"),
        ] {
            let text = format!(
                "[system]\nname = \"odd\"\njoints = 1\n[dynamics]\nmass = [[\"1\"]]\nbias = [\"{bias}\"]\n"
            );
            let odd = System::from_text(Path::new("odd.toml"), &text, &[]).unwrap();
            let error = recovered(&odd).unwrap_err();
            assert!(error.contains(said), "{bias}: {error}");
        }
    }
}
