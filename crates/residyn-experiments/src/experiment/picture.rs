use super::{Course, PERFECT, PRIOR, Results};
use residyn_plot::{
    Course as Curve, LearningPanel, Method, MethodCurve, Quantity, Scale, Spread, learning_curves,
};

/// The figure of an experiment, as SVG text: return against real transitions or against receding horizons.
pub fn picture(results: &Results) -> String {
    let horizons = results.receding_horizon.as_deref();
    let mut others = 0;
    let curves = (results.methods.iter()).map(|(name, course)| MethodCurve {
        method: method(name, &mut others),
        label: name.replace('_', " "),
        course: curve(course, horizons),
    });
    let (x, x_scale) = match horizons {
        Some(_) => (Quantity::new("receding horizon", "steps"), Scale::Linear),
        None => (Quantity::new("real transitions", ""), Scale::Logarithmic),
    };
    let panel = LearningPanel {
        title: results.task.clone(),
        x,
        x_scale,
        y: Quantity::new("return", ""),
        curves: curves.collect(),
    };
    let title = format!(
        "{}: mean and standard deviation over {} seeds",
        results.experiment,
        results.seeds.len()
    );
    learning_curves(&panel, &title)
}

fn method(name: &str, others: &mut usize) -> Method {
    match name {
        PRIOR => Method::Prior,
        PERFECT => Method::Perfect,
        "hybrid" => Method::Hybrid,
        "data_driven" => Method::DataDriven,
        _ => {
            *others += 1;
            Method::Other(*others - 1)
        }
    }
}

fn curve(course: &Course, horizons: Option<&[usize]>) -> Curve {
    let spreads = course.return_mean.iter().zip(&course.return_std);
    let spreads: Vec<Spread> = spreads
        .map(|(mean, std)| Spread {
            mean: *mean,
            std: *std,
        })
        .collect();
    match (horizons, spreads.as_slice()) {
        (None, [level]) => Curve::Level(*level),
        _ => {
            let x = horizons.unwrap_or(&course.transitions).iter();
            Curve::Over(x.map(|x| *x as f64).zip(spreads).collect())
        }
    }
}
