//! Episodes of a pendulum that is planned with its own equations.

use std::path::Path;

use super::*;
use crate::plan::Method;
use residyn_core::model::Library;
use residyn_core::rng;
use residyn_io::read_plant;

/// The built-in task, in the steps of a shorter search.
fn task(method: &str) -> Task {
    let mut task = Task::read(Path::new("pendulum")).unwrap();
    task.steps = 150;
    task.replan = 5;
    task.planner.horizon = 40;
    task.planner.population = 150;
    task.planner.method = Method::usual(method, 150).unwrap();
    task.plant = PlantSettings {
        integrator: task.integrator,
        ..task.plant
    };
    task
}

/// An episode from hanging, without anything that keeps its commands or its motion within limits.
fn episode_of(task: &Task) -> Episode {
    let plant = read_plant(Path::new("pendulum-sim"), &Library::built_in()).unwrap();
    let dynamics = plant.dynamics();
    let rig = task.rig(&plant, &dynamics, &task.start);
    let mut plant = Simulated { rig, noise: rng(1) };
    let predictor = Predictor::of_equations(dynamics.clone(), task.integrator);
    with_controller(&predictor, task, task.replan, &rng(2), |controller| {
        episode(task, &mut plant, controller).unwrap()
    })
}

/// The largest distance of the position from hanging, and the largest speed.
fn farthest(episode: &Episode, start: f64) -> [f64; 2] {
    let states = episode.stretch.states.iter();
    states.fold([0.0; 2], |[angle, speed], state| {
        [
            angle.max((state[0] - start).abs()),
            speed.max(state[1].abs()),
        ]
    })
}

#[test]
fn plans_keep_a_pendulum_within_limits_that_they_would_leave() {
    for method in Method::names() {
        let free = task(method);
        let start = free.start[0];
        let mut bound = free.clone();
        bound.bounds = Bounds {
            angle: vec![Some([start - 1.0, start + 1.0])],
            speed: vec![Some(3.0)],
            brake_s: 0.1,
        };
        let [free, bound] = [free, bound].map(|task| episode_of(&task));
        let [angle, speed] = farthest(&free, start);
        assert!(angle > 1.5 && speed > 4.0, "{method} {angle} {speed}");
        let [angle, speed] = farthest(&bound, start);
        assert!(angle <= 1.0 && speed <= 3.0, "{method} {angle} {speed}");
        // What is left of the range is used.
        assert!(angle > 0.7, "{method} {angle}");
        assert!(bound.total() < free.total(), "{method}");
    }
}

#[test]
fn a_plan_outside_its_limits_goes_back_into_them() {
    for method in Method::names() {
        let mut task = task(method);
        let start = task.start[0];
        task.start = vec![start + 0.6, 0.0];
        task.bounds.angle = vec![Some([start - 0.5, start + 0.5])];
        let states = episode_of(&task).stretch.states;
        let beyond = states
            .iter()
            .rposition(|state| (state[0] - start).abs() > 0.5);
        assert!(beyond.is_some_and(|last| last < 30), "{method} {beyond:?}");
    }
}

#[test]
fn plans_within_limits_do_not_depend_on_the_scale_of_the_objective() {
    for method in Method::names() {
        let motion = |objective: &str| {
            let mut task = task(method);
            task.steps = 40;
            task.objective = objective.to_owned();
            task.bounds.angle = vec![Some([task.start[0] - 0.5, task.start[0] + 0.5])];
            episode_of(&task).stretch.states
        };
        // A power of two changes no rounding.
        assert_eq!(motion("cos(q1)"), motion("1048576 * cos(q1)"), "{method}");
    }
}

/// A plant that does not wait, and lets so many steps pass beyond the first.
struct Hasty {
    late: usize,
    time_s: f64,
    asked: Vec<[Vec<Vec<f64>>; 2]>,
}

impl Driven for Hasty {
    fn empty_log(&self) -> residyn_core::data::Log {
        residyn_core::data::Log::empty(1)
    }

    fn time_s(&self) -> f64 {
        self.time_s
    }

    fn measure(&mut self) -> Vec<f64> {
        vec![3.0, 0.0]
    }

    fn state(&self) -> &[f64] {
        &[3.0, 0.0]
    }

    fn safe(&self) -> Vec<f64> {
        vec![0.0]
    }

    fn step(&mut self, command: &[f64], next: &[Vec<f64>]) -> Result<Held, DriveError> {
        self.asked.push([vec![command.to_vec()], next.to_vec()]);
        self.time_s += 0.02 * (1 + self.late) as f64;
        let steps = [&[command.to_vec()], &next[..self.late]].concat();
        Ok(Held {
            sent: command.to_vec(),
            steps,
        })
    }
}

#[test]
fn a_plant_that_does_not_wait_is_given_the_rest_of_the_plan() {
    let task = task("cem");
    let plant = read_plant(Path::new("pendulum-sim"), &Library::built_in()).unwrap();
    let predictor = Predictor::of_equations(plant.dynamics(), task.integrator);
    let mut plant = Hasty {
        late: 1,
        time_s: 0.0,
        asked: Vec::new(),
    };
    let decisions = with_controller(&predictor, &task, 4, &rng(2), |controller| {
        drive(&mut plant, controller, 4).unwrap();
        controller.decisions()
    });
    // Two steps pass for each command of a plan of four.
    assert_eq!(decisions, 2);
    let [command, next] = &plant.asked[0];
    let plan = [command.as_slice(), next].concat();
    assert_eq!(plan.len(), task.planner.horizon);
    let [command, next] = &plant.asked[1];
    assert_eq!([command.as_slice(), next].concat(), plan[2..]);
}
