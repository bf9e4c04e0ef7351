//! The equations of motion of a tree, M(q) qdd + h(q, qd) + g dV/dq = tau, linear in the physical parameters.
//!
//! Velocities are propagated from link to link as Jacobians (the share of each joint), in the axes of each link. The
//! contribution of one unit of a parameter to the mass matrix and to the potential is then a sum of products.

use nalgebra::{Matrix3, Vector3};

use super::body::Joint;
use super::series::Series;
use super::spatial::PARTS;
use crate::data;

/// A vector of functions.
type Vector = [Series; 3];

/// A kind of physical parameter. If the motion determines only combinations, kinds about the axis are preferred.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Entries of the inertia tensor about the joint's frame.
    Tensor(usize, usize),
    /// Mass times centre of mass, along an axis of the frame.
    Moment(usize),
    Mass,
    /// Rotor inertia of the drive, added to the joint's own inertia.
    Rotor,
}

/// In order of preference, for a link that turns.
const OF_TURNING: [Kind; PARTS] = [
    Kind::Tensor(2, 2),
    Kind::Moment(0),
    Kind::Moment(1),
    Kind::Tensor(0, 0),
    Kind::Tensor(0, 1),
    Kind::Tensor(0, 2),
    Kind::Tensor(1, 1),
    Kind::Tensor(1, 2),
    Kind::Moment(2),
    Kind::Mass,
];

/// A physical parameter and the contribution of one unit of it to the equations.
#[derive(Debug, Clone)]
pub(super) struct Column {
    pub kind: Kind,
    /// Counted from 0.
    pub joint: data::Joint,
    pub value: f64,
    pub mass: Vec<Vec<Series>>,
    /// Potential energy per m/s^2 of gravity, without its constant.
    pub potential: Series,
}

impl Kind {
    /// The kinds that a body has, in the order of an inertia's parts.
    pub const OF_BODY: [Self; PARTS] = [
        Self::Mass,
        Self::Moment(0),
        Self::Moment(1),
        Self::Moment(2),
        Self::Tensor(0, 0),
        Self::Tensor(0, 1),
        Self::Tensor(0, 2),
        Self::Tensor(1, 1),
        Self::Tensor(1, 2),
        Self::Tensor(2, 2),
    ];

    /// The place of a body's parameter among its parts.
    ///
    /// # Panics
    /// For a rotor's inertia.
    pub fn place(self) -> usize {
        let mut kinds = Self::OF_BODY.iter();
        kinds
            .position(|kind| *kind == self)
            .expect("rotors belong to no body")
    }

    pub fn is_never_negative(self) -> bool {
        match self {
            Self::Tensor(a, b) => a == b,
            Self::Moment(_) => false,
            Self::Mass | Self::Rotor => true,
        }
    }

    /// `zz`, `mx`, `m`, `J`.
    pub fn stem(self) -> String {
        let axis = |k: usize| ["x", "y", "z"][k];
        match self {
            Self::Tensor(a, b) => format!("{}{}", axis(a), axis(b)),
            Self::Moment(a) => format!("m{}", axis(a)),
            Self::Mass => "m".into(),
            Self::Rotor => "J".into(),
        }
    }

    /// Exponent of length in the unit of its mass-matrix coefficients between joints that turn.
    fn lengths(self) -> i32 {
        match self {
            Self::Tensor(..) | Self::Rotor => 0,
            Self::Moment(_) => 1,
            Self::Mass => 2,
        }
    }

    /// The value of a joint's parameter; 0 if it is rounding.
    pub fn value(self, joint: &Joint) -> f64 {
        let (inertia, size) = (&joint.inertia, joint.inertia.tensor.trace());
        let (value, size) = match self {
            Self::Tensor(a, b) => (inertia.tensor[(a, b)], size),
            Self::Moment(a) => (inertia.moment[a], (inertia.mass * size).sqrt()),
            Self::Mass => (inertia.mass, inertia.mass),
            Self::Rotor => (joint.drivetrain.armature, joint.drivetrain.armature),
        };
        if value.abs() > 1e-12 * size {
            value
        } else {
            0.0
        }
    }
}

/// The non-zero parameters of a tree, in order of preference, rotors last.
pub(super) fn columns(joints: &[Joint], gravity: &Vector3<f64>) -> Vec<Column> {
    let lengths = Lengths::of(joints);
    let base = Frame::base(joints.len(), gravity);
    let mut frames: Vec<Frame> = Vec::with_capacity(joints.len());
    let mut columns = Vec::new();
    for (k, joint) in joints.iter().enumerate() {
        let parent = joint.parent.map_or(&base, |parent| &frames[parent]);
        let frame = parent.beyond(k, joint);
        let mut kinds = OF_TURNING;
        if joint.slides {
            kinds.rotate_right(1);
        }
        columns.extend(kinds.map(|kind| frame.column(kind, k, joint)));
        frames.push(frame);
    }
    columns.extend(joints.iter().enumerate().map(|(k, joint)| Column {
        mass: rotor(joints.len(), k),
        kind: Kind::Rotor,
        joint: data::Joint::at(k),
        value: Kind::Rotor.value(joint),
        potential: Series::default(),
    }));
    columns.retain(|column| column.value != 0.0);
    columns.iter_mut().for_each(|column| lengths.clean(column));
    columns
}

/// The coefficient of qd_j qd_k in equation i, both orders of j and k together, for this mass matrix.
pub(super) fn christoffel(mass: &[Vec<Series>], i: usize, j: usize, k: usize) -> Series {
    let slopes = &mass[i][j].derivative(k) + &mass[i][k].derivative(j);
    let both = &slopes - &mass[j][k].derivative(i);
    &both * if j == k { 0.5 } else { 1.0 }
}

fn rotor(joints: usize, joint: usize) -> Vec<Vec<Series>> {
    let mut mass = vec![vec![Series::default(); joints]; joints];
    mass[joint][joint] = Series::constant(1.0);
    mass
}

/// The motion of a link's frame, in its own axes.
struct Frame {
    /// For each joint, the velocity of the origin per unit of joint velocity.
    linear: Vec<Vector>,
    /// The same for the angular velocity.
    angular: Vec<Vector>,
    /// The direction of gravity.
    down: Vector,
    /// Depth of the origin along gravity, m.
    depth: Series,
}

impl Frame {
    fn base(joints: usize, gravity: &Vector3<f64>) -> Self {
        let direction = gravity.try_normalize(0.0).unwrap_or_default();
        Self {
            linear: vec![Vector::default(); joints],
            angular: vec![Vector::default(); joints],
            down: constant(&direction),
            depth: Series::default(),
        }
    }

    /// The frame of the link that joint `k` moves, from that of its parent (this one).
    fn beyond(&self, k: usize, joint: &Joint) -> Self {
        let step = origin(k, joint);
        let carried = |(v, w): (&Vector, &Vector)| inward(k, joint, &add(v, &cross(w, &step)));
        let mut linear: Vec<Vector> = self.linear.iter().zip(&self.angular).map(carried).collect();
        let mut angular: Vec<Vector> = self.angular.iter().map(|w| inward(k, joint, w)).collect();
        let own = if joint.slides {
            &mut linear
        } else {
            &mut angular
        };
        own[k] = constant(&Vector3::z());
        Self {
            linear,
            angular,
            down: inward(k, joint, &self.down),
            depth: &self.depth + &dot(&self.down, &step),
        }
    }

    fn column(&self, kind: Kind, k: usize, joint: &Joint) -> Column {
        let n = self.linear.len();
        let row = |i| (0..n).map(|j| self.entry(kind, i, j)).collect();
        let potential = match kind {
            Kind::Mass => -&self.depth,
            Kind::Moment(a) => -&self.down[a],
            Kind::Tensor(..) | Kind::Rotor => Series::default(),
        };
        Column {
            kind,
            joint: data::Joint::at(k),
            value: kind.value(joint),
            mass: (0..n).map(row).collect(),
            potential: potential.without_constant(),
        }
    }

    /// Kinetic energy is (m v.v + w.I w + 2 mc.(v x w)) / 2.
    fn entry(&self, kind: Kind, i: usize, j: usize) -> Series {
        let ([v, w], [v_j, w_j]) = (
            [&self.linear[i], &self.angular[i]],
            [&self.linear[j], &self.angular[j]],
        );
        match kind {
            Kind::Mass => dot(v, v_j),
            Kind::Moment(a) => &cross(v, w_j)[a] + &cross(v_j, w)[a],
            Kind::Tensor(a, b) if a == b => &w[a] * &w_j[a],
            Kind::Tensor(a, b) => &(&w[a] * &w_j[b]) + &(&w[b] * &w_j[a]),
            Kind::Rotor => unreachable!("rotors have no frame"),
        }
    }
}

/// The origin of the link's frame in the frame of its parent.
fn origin(k: usize, joint: &Joint) -> Vector {
    let rest = constant(&joint.pose.origin);
    if !joint.slides {
        return rest;
    }
    let moved = &Series::coordinate(k) - &Series::constant(joint.reference);
    let along: Vector3<f64> = joint.pose.rotation.column(2).into();
    add(&rest, &std::array::from_fn(|a| &moved * along[a]))
}

/// A vector of the parent in the axes of the link that joint `k` moves.
fn inward(k: usize, joint: &Joint, vector: &Vector) -> Vector {
    let at_rest = turned(&joint.pose.rotation.transpose(), vector);
    if joint.slides {
        return at_rest;
    }
    let (sin, cos) = joint.reference.sin_cos();
    let c = &(&Series::cos(k) * cos) + &(&Series::sin(k) * sin);
    let s = &(&Series::sin(k) * cos) - &(&Series::cos(k) * sin);
    let [x, y, z] = at_rest;
    [&(&c * &x) + &(&s * &y), &(&c * &y) - &(&s * &x), z]
}

fn constant(vector: &Vector3<f64>) -> Vector {
    std::array::from_fn(|a| Series::constant(vector[a]))
}

fn add(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|k| &a[k] + &b[k])
}

fn dot(a: &Vector, b: &Vector) -> Series {
    let products = a.iter().zip(b).map(|(a, b)| a * b);
    products.fold(Series::default(), |sum, product| &sum + &product)
}

fn cross(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        &(&a[i] * &b[j]) - &(&a[j] * &b[i])
    })
}

fn turned(by: &Matrix3<f64>, vector: &Vector) -> Vector {
    std::array::from_fn(|a| {
        let parts = (0..3).map(|b| &vector[b] * by[(a, b)]);
        parts.fold(Series::default(), |sum, part| &sum + &part)
    })
}

/// Typical magnitudes of coefficients: a power of the links' length, by unit.
#[derive(Debug, Clone)]
pub(super) struct Lengths {
    /// m
    length: f64,
    slides: Vec<bool>,
}

impl Lengths {
    pub fn of(joints: &[Joint]) -> Self {
        let carried = joints.iter().filter(|joint| joint.parent.is_some());
        let offsets = carried.map(|joint| joint.pose.origin.norm());
        let longest = offsets.fold(0.0, f64::max);
        Self {
            length: if longest > 0.0 { longest } else { 1.0 },
            slides: joints.iter().map(|joint| joint.slides).collect(),
        }
    }

    /// A coefficient of a parameter in an equation of these joints, without rounding errors.
    pub fn cleaned(&self, kind: Kind, of: &[usize], series: &Series) -> Series {
        self.with_powers(self.powers(kind, of), series)
    }

    /// The power of length in the unit of a parameter's coefficient in an equation of these joints.
    pub fn powers(&self, kind: Kind, of: &[usize]) -> i32 {
        let sliding = of.iter().map(|joint| i32::from(self.slides[*joint]));
        kind.lengths() - sliding.sum::<i32>()
    }

    fn with_powers(&self, lengths: i32, series: &Series) -> Series {
        series.cleaned(|wave| self.length.powi(lengths - wave.lengths()))
    }

    fn clean(&self, column: &mut Column) {
        for (i, row) in column.mass.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                *entry = self.cleaned(column.kind, &[i, j], entry);
            }
        }
        column.potential = self.with_powers(column.kind.lengths() - 1, &column.potential);
    }
}
