//! What reports of closing the loop say.

use serde_json::Value;

/// The names of the established effects.
pub fn names(report: &Value) -> Vec<&str> {
    let effects = report["effects"].as_array().unwrap();
    let names = effects.iter().map(|effect| effect["name"].as_str());
    names.map(Option::unwrap).collect()
}

/// A model's error 0.5 s ahead on the first joint.
pub fn error(report: &Value, model: &str) -> f64 {
    error_of_joint(report, model, 0)
}

/// A model's error 0.5 s ahead on a joint, counted from 0.
pub fn error_of_joint(report: &Value, model: &str, joint: usize) -> f64 {
    assert_eq!(report["error"]["horizons_s"][1], 0.5);
    let errors = &report["error"][model]["position_rmse"][1];
    errors[joint].as_f64().unwrap()
}

/// The value of an effect's or a model's parameter, and the ends of its interval.
pub fn estimate(parameter: &Value) -> Option<[f64; 3]> {
    let ends = parameter["ci95"].as_array()?;
    Some([
        parameter["value"].as_f64()?,
        ends[0].as_f64()?,
        ends[1].as_f64()?,
    ])
}
