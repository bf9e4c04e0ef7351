//! Masses, lengths and inertias of links that have the fitted equations.

use nalgebra::{Complex, Matrix3, Vector3};

use super::shape::{ROUNDING, SAME, beyond_rounding};
use crate::model::tree::spatial::with_z_along;
use crate::model::tree::{Drivetrain, Inertia, Joint, Pose};

/// A point or vector of the plane in which links turn, as z + i x with z up. A rotation by q about y multiplies it by
/// exp(i q).
pub(super) type Planar = Complex<f64>;

/// Radius of gyration of a body whose mass the motion does not determine, m.
const GYRATION: f64 = 0.1;

/// Joints in the world frame, and gravity (m/s^2) as a vector of the plane.
pub(super) type Links = (Vec<Joint>, Planar);

/// Builds the links from the coefficients of [`Shape`](super::shape::Shape) and gravity (m/s^2).
///
/// # Errors
/// Coefficients that no bodies can have.
pub(super) type Build = fn(&[f64], f64) -> Result<Links, String>;

/// A link that turns. `found` are the coefficients of [`Shape`](super::shape::Shape), `gravity` in m/s^2; likewise
/// below.
pub(super) fn turning(found: &[f64], gravity: f64) -> Result<Links, String> {
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

/// A body on a slide.
pub(super) fn sliding(found: &[f64], gravity: f64) -> Result<Links, String> {
    let [mass, force, ..] = found[..] else {
        unreachable!("the shape has these")
    };
    Ok((vec![slide(mass)?], inclined(mass, force, gravity)))
}

/// The gravity vector under which a slide along x needs this static force.
fn inclined(mass: f64, force: f64, gravity: f64) -> Planar {
    let along = -force / mass;
    let across = (gravity.powi(2) - along.powi(2)).max(0.0).sqrt();
    Planar::new(-across, beyond_rounding(along, gravity))
}

/// Two links that turn in one plane.
pub(super) fn arm(found: &[f64], gravity: f64) -> Result<Links, String> {
    let [first, c, s, second, rotor, cos_1, sin_1, cos_2, sin_2, ..] = found[..] else {
        unreachable!("the shape has these")
    };
    // Conjugate of the vector to the second joint, times the first moment of the second link.
    let coupling = Planar::new(c, -s);
    let (moment_1, moment_2) = (weight(cos_1, sin_1, gravity), weight(cos_2, sin_2, gravity));
    let weighs = |moment: Planar, inertia: f64| moment.norm() > ROUNDING * inertia;
    let (elbow, moment_2, downward) = if weighs(moment_2, second) {
        (clean((coupling / moment_2).conj()), moment_2, gravity)
    } else if weighs(moment_1, first) && weighs(coupling, second) {
        return Err("gravity acts on the first link alone".into());
    } else {
        // Without weight the length is arbitrary.
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
        return Err("the second link has less inertia about its own joint than in the coupling with the first".into());
    }
    let mut outer = joint(2, elbow, link(second, moment_2, mass_2)?);
    outer.drivetrain.armature = beyond_rounding(rotor, second);
    let inner = joint(
        1,
        Planar::new(0.0, 0.0),
        link(own, moment_1, likely_mass(own, moment_1))?,
    );
    Ok((vec![inner, outer], Planar::new(-downward, 0.0)))
}

/// A link that turns on a body that slides.
pub(super) fn on_a_slide(found: &[f64], gravity: f64) -> Result<Links, String> {
    let [mass, c, s, inertia, force, cos, sin, ..] = found[..] else {
        unreachable!("the shape has these")
    };
    let moment = clean(Planar::new(c, -s));
    let pull = Planar::new(sin, cos);
    let rounding = ROUNDING * (mass * inertia).sqrt();
    let downward = if moment.norm() > rounding {
        near(-gravity, (pull / moment).conj())
    } else if pull.norm() > rounding * gravity {
        return Err("the pendulum has a weight that does not move the slide".into());
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

/// Mass times centre of mass (kg m) for the gravity torque `cos` cos q + `sin` sin q (N m).
fn weight(cos: f64, sin: f64, gravity: f64) -> Planar {
    clean(Planar::new(-sin / gravity, -cos / gravity))
}

/// Drops a component that is rounding relative to the other.
fn clean(found: Planar) -> Planar {
    let part = |part: f64| beyond_rounding(part, found.norm());
    Planar::new(part(found.re), part(found.im))
}

/// `found`, or the expected value if they differ by rounding alone.
fn near(expected: f64, found: Planar) -> Planar {
    let expected = Planar::new(expected, 0.0);
    if (found - expected).norm() < SAME * expected.norm() {
        expected
    } else {
        found
    }
}

/// The geometric mean of the least mass that the second link allows and the most that the first allows, kg.
fn mass_between(least: f64, most: f64) -> f64 {
    if least > ROUNDING * most {
        (least * most).sqrt()
    } else {
        0.5 * most
    }
}

/// The mass (kg) whose distance from the axis makes up half of the inertia.
fn likely_mass(inertia: f64, moment: Planar) -> f64 {
    let mass = 2.0 * moment.norm_sqr() / inertia;
    if mass > ROUNDING * inertia {
        mass
    } else {
        inertia / GYRATION.powi(2)
    }
}

/// A link in its joint's frame, with equal principal moments about its centre of mass.
fn link(inertia: f64, moment: Planar, mass: f64) -> Result<Inertia, String> {
    let own = inertia - moment.norm_sqr() / mass;
    if !(mass > 0.0 && own > 0.0) {
        return Err("no physical bodies have such inertia".into());
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

/// A joint about y at a point of the plane, in the world frame.
fn joint(number: usize, at: Planar, inertia: Inertia) -> Joint {
    plain(
        number,
        Vector3::y(),
        Vector3::new(at.im, 0.0, at.re),
        inertia,
    )
}

/// A slide along x, in the world frame.
fn slide(mass: f64) -> Result<Joint, String> {
    if mass <= 0.0 {
        return Err("no physical bodies have such inertia".into());
    }
    let own = Matrix3::identity() * (mass * GYRATION.powi(2));
    let inertia = Inertia::central(mass, own, &Pose::identity());
    let slide = plain(1, Vector3::x(), Vector3::zeros(), inertia);
    Ok(Joint {
        slides: true,
        ..slide
    })
}

/// A joint with inertia alone, its body aligned with the world frame.
fn plain(number: usize, axis: Vector3<f64>, origin: Vector3<f64>, inertia: Inertia) -> Joint {
    let rotation = with_z_along(axis);
    Joint {
        name: format!("joint{number}"),
        body: format!("link{number}"),
        parent: number.checked_sub(2),
        slides: false,
        pose: Pose { rotation, origin },
        reference: 0.0,
        across: rotation.column(0).into(),
        axis,
        anchor: Vector3::zeros(),
        inertia,
        follows: None,
        drivetrain: Drivetrain::default(),
    }
}
