use super::proposal::Proposal;
use super::{Cem, Evaluate, Icem, Method, Mppi, Plan, Planner, Settings};
use residyn_core::lanes::Arch;
use residyn_core::rng;
use residyn_core::sim::batch::{Rows, W};

mod noise;
mod swing_up;

const SETTINGS: Settings = Settings {
    population: 300,
    iterations: 10,
    horizon: 6,
    method: CEM,
};

/// The closer every input is to a goal, the better, in some unit of return; from 2 on the return is unknown.
struct Near(f32);

impl Evaluate for Near {
    type Start = f32;

    fn returns(&mut self, goal: &f32, inputs: &[Rows], returns: &mut Rows) {
        for lane in 0..W {
            let off = inputs
                .iter()
                .map(|row| (row[lane] - goal).powi(2))
                .sum::<f32>();
            let known = inputs.iter().all(|row| row[lane] < 2.0);
            returns[lane] = if known { -off * self.0 } else { f32::NAN };
        }
    }
}

const CEM: Method = Method::Cem(Cem { elite: 20 });

fn icem() -> Method {
    Method::Icem(Icem::new(20))
}

/// Path-integral control whose mean does not scatter far from the best sequence.
fn narrow_mppi() -> Method {
    Method::Mppi(Mppi {
        deviation: 0.1,
        ..Mppi::default()
    })
}

fn with(method: Method) -> Settings {
    Settings { method, ..SETTINGS }
}

/// Every method by its name.
fn all() -> Vec<Settings> {
    let usual = |name| match Method::usual(name, SETTINGS.population).unwrap() {
        Method::Mppi(_) => narrow_mppi(),
        method => method,
    };
    Method::names().map(usual).map(with).to_vec()
}

fn near(settings: &Settings, bounds: &[[f64; 2]], seed: u64) -> Planner<Near> {
    Planner::new(settings, bounds, || Near(1.0), &rng(seed))
}

/// The largest distance of a plan's inputs from the goal.
fn off(plan: &Plan, goal: f64) -> f64 {
    let off = plan.inputs.iter().flatten().map(|x| (x - goal).abs());
    off.fold(0.0, f64::max)
}

#[test]
fn the_search_finds_the_best_sequence() {
    for settings in [CEM, icem()].map(with) {
        let plan = near(&settings, &[[-3.0, 3.0]; 2], 1).plan(0.7);
        assert_eq!(plan.inputs.len(), SETTINGS.horizon);
        assert!(off(&plan, 0.7) < 0.1, "{settings:?} {plan:?}");
        assert!(plan.best > -0.05, "{settings:?} {plan:?}");
    }
}

#[test]
fn mppi_finds_the_best_sequence_within_its_standard_deviation() {
    let settings = |temperature: f64| Settings {
        method: Method::Mppi(Mppi {
            temperature,
            deviation: 0.1,
        }),
        ..SETTINGS
    };
    let found = |temperature: f64| {
        let plan = near(&settings(temperature), &[[-3.0, 3.0]; 2], 1).plan(0.7);
        off(&plan, 0.7)
    };
    // One standard deviation is 0.3. The hotter, the more candidates a mean is taken over.
    assert!(
        found(0.05) < 0.3 && found(0.3) < 0.5 * found(0.01),
        "{} {} {}",
        found(0.05),
        found(0.3),
        found(0.01)
    );
}

#[test]
fn inputs_stay_within_their_bounds() {
    let plan = |settings| near(&settings, &[[-3.0, 3.0], [-0.5, 0.1]], 2).plan(1.0);
    for settings in all() {
        for step in plan(settings).inputs {
            let kept =
                (-3.0..=3.0).contains(&step[0]) && (-0.5..=0.1f32).contains(&(step[1] as f32));
            assert!(kept, "{settings:?} {step:?}");
        }
    }
    for settings in [CEM, icem()].map(with) {
        for step in plan(settings).inputs {
            let reached = (step[0] - 1.0).abs() < 0.1 && step[1] > 0.08;
            assert!(reached, "{settings:?} {step:?}");
        }
    }
}

#[test]
fn diverging_candidates_rank_last() {
    // The best known sequences border on those with unknown returns.
    let plan = |settings| near(&settings, &[[-3.0, 3.0]], 3).plan(2.5);
    let inputs = |plan: &Plan| plan.inputs.concat().into_iter();
    for settings in [CEM, icem(), narrow_mppi()].map(with) {
        let plan = plan(settings);
        assert!(inputs(&plan).all(|x| x >= 1.5), "{settings:?} {plan:?}");
    }
    for settings in all() {
        let plan = plan(settings);
        assert!(inputs(&plan).all(|x| x < 2.0), "{settings:?} {plan:?}");
        assert!(plan.diverged > 0, "{settings:?} {plan:?}");
        let lost = near(&settings, &[[2.5, 3.0]], 3).plan(2.5);
        assert_eq!(lost.best, f64::NEG_INFINITY);
        assert_eq!(lost.diverged, SETTINGS.population * SETTINGS.iterations);
        assert!(lost.inputs.iter().flatten().all(|x| *x == 2.75));
    }
}

#[test]
fn the_rest_of_a_plan_starts_the_next_search() {
    for settings in [CEM, narrow_mppi()].map(with) {
        let short = Settings {
            iterations: 1,
            ..settings
        };
        let errors = |warm: bool| {
            let search = near(&short, &[[-3.0, 3.0]], 4);
            for _ in 0..8 {
                search.plan(-1.5);
            }
            search.shift(2);
            if !warm {
                search.forget();
            }
            let plan = search.plan(-1.5);
            let off = plan.inputs[..4].iter().map(|step| (step[0] + 1.5).abs());
            off.sum::<f64>()
        };
        let [warm, cold] = [true, false].map(errors);
        assert!(warm < 0.5 * cold, "{settings:?} {warm} {cold}");
    }
}

#[test]
fn a_plan_does_not_depend_on_the_number_of_cores() {
    for settings in all() {
        let alone = near(&settings, &[[-3.0, 3.0]], 5).plan(0.3);
        let with_help = near(&settings, &[[-3.0, 3.0]], 5);
        assert_eq!(with_help.with_workers(|| with_help.plan(0.3)), alone);
        let other = near(&settings, &[[-3.0, 3.0]], 6);
        assert_ne!(other.plan(0.3), alone);
    }
}

#[test]
fn icem_never_loses_its_best_candidate() {
    let plans: Vec<Plan> = (1..=SETTINGS.iterations)
        .map(|iterations| {
            let settings = Settings {
                iterations,
                method: Method::Icem(Icem {
                    keep: 0.0,
                    ..Icem::new(20)
                }),
                ..SETTINGS
            };
            near(&settings, &[[-3.0, 3.0]], 8).plan(0.7)
        })
        .collect();
    for pair in plans.windows(2) {
        assert!(pair[0].best <= pair[1].best, "{pair:?}");
    }
    for plan in plans {
        let sequence: Vec<_> = plan
            .inputs
            .iter()
            .map(|step| Rows::splat(step[0] as f32))
            .collect();
        let mut returns = Rows::splat(0.0);
        Near(1.0).returns(&0.7, &sequence, &mut returns);
        assert_eq!(f64::from(returns[0]), plan.best);
    }
}

#[test]
fn icem_keeps_its_best_candidates_from_one_search_to_the_next() {
    let settings = Settings {
        iterations: 1,
        method: Method::Icem(Icem::new(20)),
        ..SETTINGS
    };
    let search = near(&settings, &[[-3.0, 3.0]], 12);
    let bests = |_: usize| search.plan(0.7).best;
    let bests: Vec<f64> = (0..8).map(bests).collect();
    assert!(bests.is_sorted() && bests[0] < bests[7], "{bests:?}");
}

#[test]
fn the_unexecuted_part_of_a_kept_sequence_is_a_candidate() {
    let mut proposal = Proposal::new(&[[-3.0, 3.0]; 2], 3);
    proposal.begin(0.5);
    proposal.keep(vec![vec![0.1, 0.2, 0.3, 0.4, 0.5, 0.6]]);
    proposal.shift(1);
    let mut rows = vec![Rows::splat(1.0); 6];
    proposal.place(Arch::new(), 0, &mut rows);
    let lane = |lane: usize| -> Vec<f32> { rows.iter().map(|row| row[lane]).collect() };
    assert_eq!(lane(0), [0.3, 0.4, 0.5, 0.6, 1.5, 1.5]);
    assert_eq!(lane(1), [1.5; 6]);
    proposal.forget();
    proposal.place(Arch::new(), 0, &mut rows);
    assert_ne!(rows[0][0], 0.3);
}

#[test]
fn mppi_is_invariant_to_scale_and_offset_of_returns() {
    let settings = Settings {
        method: Method::Mppi(Mppi::default()),
        ..SETTINGS
    };
    // A power of two: nothing is rounded.
    let scaled = Planner::new(&settings, &[[-3.0, 3.0]], || Near(1024.0), &rng(9));
    let plan = near(&settings, &[[-3.0, 3.0]], 9).plan(0.7);
    assert_eq!(scaled.plan(0.7).inputs, plan.inputs);
}

#[test]
fn settings_are_read_from_a_file_and_written_back() {
    let read = |rest: &str| -> Result<Settings, toml::de::Error> {
        let text = format!("population = 300\niterations = 10\nhorizon = 6\n{rest}");
        toml::from_str(&text)
    };
    let written = [
        ("method = 'cem'\nelite = 20", CEM),
        ("method = 'icem'\nelite = 20", icem()),
        ("method = 'mppi'\ndeviation = 0.1", narrow_mppi()),
    ];
    for (text, method) in written {
        let settings = Settings { method, ..SETTINGS };
        assert_eq!(read(text).unwrap(), settings);
        let copy = toml::from_str(&toml::to_string(&settings).unwrap());
        assert_eq!(copy, Ok(settings));
    }
    for (text, wanted) in [
        ("method = 'cem'", "missing field `elite`"),
        (
            "method = 'cem'\nelite = 20\nelit = 2",
            "unknown field `elit`",
        ),
        ("method = 'mppi'\nelite = 20", "unknown field `elite`"),
    ] {
        let found = read(text).unwrap_err().to_string();
        assert!(found.contains(wanted), "{text}: {found}");
    }
}

#[test]
fn every_method_is_known_by_its_name() {
    for (name, settings) in Method::names().into_iter().zip(all()) {
        let text = toml::to_string(&settings).unwrap();
        assert!(text.contains(&format!("method = \"{name}\"")), "{text}");
    }
    let text = "population = 300\niterations = 10\nhorizon = 6\nmethod = 'sac'";
    let refused = toml::from_str::<Settings>(text).unwrap_err().to_string();
    let names = Method::names().map(|name| format!("`{name}`"));
    let known = format!(
        "unknown variant `sac`, expected one of {}",
        names.join(", ")
    );
    assert!(refused.contains(&known), "{refused}");
}

#[test]
fn usual_settings_are_accepted() {
    for settings in all() {
        assert_eq!(settings.check(), Ok(()));
    }
}

#[test]
fn bad_settings_are_refused_by_name() {
    let read = |[population, iterations, horizon]: [usize; 3], method: &str| -> Settings {
        toml::from_str(&format!(
            "population = {population}\niterations = {iterations}\nhorizon = {horizon}\n{method}"
        ))
        .unwrap()
    };
    let cem = "method = 'cem'\nelite = 20";
    for (counts, wanted) in [
        (
            [0, 1, 1],
            "`population` is 0; it must be a whole number from 1 to 100000",
        ),
        (
            [19, 1, 1],
            "`elite` is 20; it must be a whole number from 1 to 19, the population",
        ),
        (
            [20, 0, 1],
            "`iterations` is 0; it must be a whole number from 1 to 10000",
        ),
        (
            [20, 1, 2001],
            "`horizon` is 2001; it must be a whole number from 1 to 2000",
        ),
    ] {
        let message = read(counts, cem).check().unwrap_err().to_string();
        assert_eq!(message, wanted);
    }
    let icem = "method = 'icem'\nelite = ";
    let mppi = "method = 'mppi'\n";
    for (method, numbers, wanted) in [
        (
            icem,
            "0",
            "`elite` is 0; it must be a whole number from 1 to 300, the population",
        ),
        (
            icem,
            "20\nnoise_exponent = -1.0",
            "`noise_exponent` is -1; it must be from 0 to 10",
        ),
        (
            icem,
            "20\nkeep = 1.5",
            "`keep` is 1.5; it must be from 0 to 1",
        ),
        (
            icem,
            "20\nmomentum = nan",
            "`momentum` is NaN; it must be at least 0 and below 1",
        ),
        (
            mppi,
            "temperature = 0.0",
            "`temperature` is 0; it must be above 0 and at most 10",
        ),
        (
            mppi,
            "deviation = inf",
            "`deviation` is inf; it must be above 0 and at most 10",
        ),
    ] {
        let settings = read([300, 10, 6], &(method.to_owned() + numbers));
        assert_eq!(settings.check().unwrap_err().to_string(), wanted);
    }
}
