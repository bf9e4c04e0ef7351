//! temporary diagnosis
#[path = "../examples/watch/machines.rs"]
mod machines;

use crate::{Monitor, Settings};

#[test]
fn diagnose() {
    for (name, plant) in [("joint", machines::joint()), ("arm", machines::arm()), ("servo", machines::servo_arm(2))] {
        for noise in [0.0, 2e-4] {
            for h in [0.08, 0.12, 0.2] {
                let mut plant = plant.clone();
                plant.sensor.position_noise = noise;
                let rows = machines::piece(&plant, 0.0, 130.0, 5);
                let mut monitor = Monitor::new(&machines::model(&plant), Settings { healthy_s: 60.0, smoothing_s: Some(h), ..Settings::default() }).unwrap();
                monitor.update(&rows).unwrap();
                let w = monitor.watch.as_ref().unwrap();
                let sd: Vec<f64> = w.baseline.weights.iter().map(|w| 1.0 / w.sqrt()).collect();
                let var: Vec<f64> = w.baseline.hypotheses.iter().map(|h| (h.variance * 100.0).round() / 100.0).collect();
                let pv: Vec<Vec<f64>> = w.baseline.probes.iter().flatten().map(|p| p.covariance.diagonal().iter().map(|v| (v * 100.0).round() / 100.0).collect()).collect();
                println!("{name} noise {noise} h {h}: sd {sd:.4?} variances {var:?} probes {pv:?}");
            }
        }
    }
}
