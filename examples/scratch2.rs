use rand::SeedableRng;
use residyn::{closeloop::*, data::*, evaluate::*, identify::*, model::*, plant::Plant};
use std::path::Path;
use std::time::Instant;
fn go(sys: &System, lib: &Library, logs: &[Log], tests: &[Log]) {
    let t = Instant::now();
    let mut study = Study::new(sys, logs);
    let base = study.fit_declared().unwrap();
    println!(
        "base {:?} scale {} held {:?} windows {} blocks {}",
        base.declared,
        base.fit.scale,
        study.held,
        study.shooting.windows.len(),
        blocks(&study.shooting).last().unwrap() + 1
    );
    println!("{:?}", t.elapsed());
    let sel = select(&study, lib.effects(), base.clone(), &mut |_| {});
    for r in &sel.rounds {
        println!(
            "round of {} chosen {:?} {:?}",
            r.candidates,
            r.chosen,
            t.elapsed()
        );
        for e in &r.evidence {
            println!(
                "   {} {} gain {:.4} p {:.2e} {:?}",
                e.effect.effect.name,
                e.effect.joint + 1,
                e.gain,
                e.p_value,
                e.effect.values.iter().map(|v| v.0).collect::<Vec<_>>()
            );
        }
    }
    let u = unexplained(&study, lib.probes(), &base, &sel.model);
    println!("{u:?} scale {}", sel.model.fit.scale);
    let un = uncertainty(&study.shooting, &sel.model.fit);
    for (i, &k) in sel.model.fit.active.iter().enumerate() {
        println!(
            "  {} = {:.5} +- {:.5}",
            sel.model.dynamics.parameters[k].name,
            sel.model.fit.values[k],
            un.half_width(i)
        );
    }
    for m in [&base, &sel.model] {
        let a = assess(&m.dynamics, |_| &m.fit.values, tests, &[0.1, 0.5, 1.0]);
        println!("{:?}", summarise(&a.horizons, sys.joints).position_rmse);
        println!("norm {}", norm(&residual_force(&study, m)));
    }
    println!("{:?}", t.elapsed());
}
fn main() {
    let lib = Library::built_in();
    let which = std::env::args().nth(1).unwrap_or_default();
    if which.contains('d') {
        let plant = Plant::read(Path::new("configs/demo.toml"), &lib).unwrap();
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(0);
        let logs: Vec<Log> = (0..plant.recording.logs)
            .map(|_| plant.record(&mut rng).unwrap())
            .collect();
        println!("{}", audit(&logs[0]));
        let text = Library::system_text("pendulum").unwrap();
        let sys = System::from_text(Path::new("x.toml"), text, lib.effects()).unwrap();
        go(&sys, &lib, &logs[..4], &logs[4..]);
    }
    let text = Library::system_text("pendulum").unwrap();
    let read = |sys: &System, f: &[&str]| {
        f.iter()
            .map(|f| Log::read(f, sys.joints, &sys.columns).unwrap())
            .collect::<Vec<_>>()
    };
    if which.contains('s') {
        let sys = System::from_text(Path::new("x.toml"), text, lib.effects()).unwrap();
        let d = "/work/shared/data/dfki_simple_pendulum/";
        let f = |n: &str| format!("{d}{n}.csv");
        let (a, b, c) = (
            f("ddp_pd_tracking"),
            f("direct_collocation_pd_tracking"),
            f("ilqr_20210706"),
        );
        go(&sys, &lib, &read(&sys, &[&a, &b]), &read(&sys, &[&c]));
        go(&sys, &lib, &read(&sys, &[&a, &c]), &read(&sys, &[&b]));
    }
    if which.contains('m') {
        let sys = System::from_text(Path::new("x.toml"), text, lib.effects()).unwrap();
        let l = read(
            &sys,
            &["/work/shared/data/multiarm_single_pendulum/free_swing_identification.csv"],
        );
        let mut l1 = l.clone();
        l1[0].leave_out.push(Interval {
            start_s: 27.0,
            end_s: 40.0,
        });
        let mut l2 = l.clone();
        l2[0].leave_out.push(Interval {
            start_s: -1.0,
            end_s: 27.5,
        });
        go(&sys, &lib, &l1, &l2);
    }
    if which.contains('c') {
        let sys = lib.system(Path::new("acrobot")).unwrap();
        let p: Vec<String> = [
            "143339", "143524", "143601", "143704", "143906", "144003", "154220",
        ]
        .iter()
        .map(|n| format!("/work/shared/data/dfki_double_pendulum_c1/sysid_{n}.csv"))
        .collect();
        let p: Vec<&str> = p.iter().map(|s| s.as_str()).collect();
        let q: Vec<String> = ["acrobot_tvlqr_01", "pendubot_tvlqr_01"]
            .iter()
            .map(|n| format!("/work/shared/data/dfki_double_pendulum_c1/{n}.csv"))
            .collect();
        let q: Vec<&str> = q.iter().map(|s| s.as_str()).collect();
        go(&sys, &lib, &read(&sys, &p), &read(&sys, &q));
    }
}
