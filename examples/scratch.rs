use residyn::{data::*, evaluate::*, expr::SignForm, identify::*, model::*};
use std::path::Path;
use std::time::Instant;
fn main() {
    let lib = Library::built_in();
    let text = Library::system_text("pendulum")
        .unwrap()
        .replace("value = 15.0", "value = -15.0");
    let run = |text: &str, files: &[&str], test: &[&str], extra: &[&str]| {
        let sys = System::from_text(Path::new("x.toml"), text, lib.effects()).unwrap();
        let read = |f: &[&str]| {
            f.iter()
                .map(|f| Log::read(f, sys.joints, &sys.columns).unwrap())
                .collect::<Vec<_>>()
        };
        let logs = read(files);
        let tests = read(test);
        let sign = vec![SignForm::Smooth { width: 0.02 }; sys.joints];
        let mut fx = vec![];
        for e in extra {
            for j in 0..sys.joints {
                let eff = lib.effect(e).unwrap();
                fx.push(FittedEffect {
                    effect: eff.clone(),
                    joint: j,
                    values: eff.parameters.iter().map(|p| (p.starts[0], None)).collect(),
                    fixed: false,
                });
            }
        }
        let dyn_ = sys.dynamics_with(&fx, &sign);
        let active: Vec<usize> = (0..dyn_.parameters.len())
            .filter(|&k| !dyn_.parameters[k].fixed)
            .collect();
        let noise: Vec<f64> = (0..sys.joints)
            .map(|j| {
                logs.iter()
                    .map(|l| {
                        let a = audit(l);
                        a.joints[j]
                            .q
                            .noise_std
                            .max(a.joints[j].q.resolution / 12f64.sqrt())
                    })
                    .fold(1e-6, f64::max)
            })
            .collect();
        let t = Instant::now();
        let mut values = dyn_.values();
        let mut f = None;
        let mut act = active.clone();
        for len in [0.15, 0.5] {
            let sh = Shooting::new(&logs, cut(&logs, len), &noise);
            let fit = fit(&sh, &dyn_, &act, &values, sh.initial_locals(0), None).unwrap();
            let id = identifiability(&dyn_, &fit);
            println!(
                "len {len} iters {} scale {} cost {} windows {} noise {:?} undetermined {:?} hold {:?}",
                fit.iterations,
                fit.scale,
                fit.cost,
                sh.windows.len(),
                noise,
                id.undetermined,
                id.hold
            );
            act.retain(|k| !id.hold.contains(k));
            values = fit.values.clone();
            let u = uncertainty(&sh, &fit);
            for (i, &k) in fit.active.iter().enumerate() {
                println!(
                    "  {} = {:.5} +- {:.5}",
                    dyn_.parameters[k].name,
                    fit.values[k],
                    u.half_width(i)
                );
            }
            f = Some(fit);
        }
        println!("fit {:?}", t.elapsed());
        let v = f.unwrap().values;
        let t = Instant::now();
        let a = assess(&dyn_, |_| &v, &tests, &[0.1, 0.5, 1.0]);
        println!(
            "{:?} step {} err {}  {:?}",
            summarise(&a.horizons, sys.joints),
            a.step_s,
            a.step_error,
            t.elapsed()
        );
    };
    let d = "/work/shared/data/dfki_simple_pendulum/";
    let f = |n: &str| format!("{d}{n}.csv");
    let (a, b, c) = (
        f("ddp_pd_tracking"),
        f("direct_collocation_pd_tracking"),
        f("ilqr_20210706"),
    );
    for extra in [
        &[][..],
        &["coulomb_friction"],
        &["coulomb_friction", "viscous_friction"],
    ] {
        run(&text, &[&a, &b], &[&c], extra);
        run(&text, &[&a, &c], &[&b], extra);
    }
    let m = "/work/shared/data/multiarm_single_pendulum/free_swing_identification.csv";
    for extra in [
        &[][..],
        &["coulomb_friction"],
        &["viscous_friction"],
        &["coulomb_friction", "viscous_friction"],
    ] {
        run(Library::system_text("pendulum").unwrap(), &[m], &[m], extra);
    }
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
    for extra in [&[][..], &["coulomb_friction", "viscous_friction"]] {
        run(Library::system_text("acrobot").unwrap(), &p, &q, extra);
    }
}
