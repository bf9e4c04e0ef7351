use crate::model::Parameter;

/// A value in the model file that the training logs contradict.
#[derive(Debug, Clone, PartialEq)]
pub struct Contradicted {
    /// The value in the file, in the parameter's unit.
    pub declared: f64,
    /// The parameter as fitted with the effects that were found; its 95 % interval does not contain the declared value.
    /// Without those effects the fit would bias the declared parameters to make up for what is missing.
    pub fitted: Parameter,
}

/// The declared values that lie outside the intervals of the fitted ones. Both are in the same order, and further
/// fitted parameters may follow. A parameter without an interval was not fitted and contradicts nothing; one declared
/// fixed has another value only as a finding, `parameter_shift`.
pub(in crate::closeloop) fn contradicted(
    declared: &[Parameter],
    fitted: &[Parameter],
) -> Vec<Contradicted> {
    let outside = |(declared, fitted): (&Parameter, &Parameter)| {
        let [low, high] = fitted.ci95.filter(|_| !declared.fixed)?;
        (!(low..=high).contains(&declared.value)).then(|| Contradicted {
            declared: declared.value,
            fitted: fitted.clone(),
        })
    };
    declared.iter().zip(fitted).filter_map(outside).collect()
}

impl Contradicted {
    /// How the fitted value compares with the declared one, in words: `2.9 times as large`.
    pub fn comparison(&self) -> String {
        let ratio = self.fitted.value / self.declared;
        if self.declared == 0.0 {
            "not zero".into()
        } else if ratio <= 0.0 {
            "not of that sign".into()
        } else if (0.8..1.25).contains(&ratio) {
            let direction = if ratio > 1.0 { "larger" } else { "smaller" };
            format!("{:.1} % {direction}", 100.0 * (ratio - 1.0).abs())
        } else {
            // Two digits, however small it is.
            let digits = (1.0 - ratio.log10().floor()).clamp(2.0, 20.0) as usize;
            format!("{ratio:.digits$} times as large")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fitted(value: f64, ci95: Option<[f64; 2]>) -> Parameter {
        Parameter {
            name: "J".into(),
            value,
            unit: "kg m^2".into(),
            bounds: [0.0, f64::INFINITY],
            fixed: false,
            per_log: false,
            per_group: false,
            ci95,
            scale: 1.0,
        }
    }

    #[test]
    fn values_outside_of_their_interval_are_contradicted() {
        let parameters = [
            fitted(0.29, Some([0.28, 0.30])),
            fitted(0.29, Some([0.1, 0.4])),
            fitted(0.29, None),
        ];
        let declared = vec![fitted(0.102, None); 3];
        let found = contradicted(&declared, &parameters);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].comparison(), "2.84 times as large");
    }

    #[test]
    fn ratios_are_written_in_words() {
        let says = |declared: f64, value: f64| {
            let fitted = fitted(value, None);
            Contradicted { declared, fitted }.comparison()
        };
        assert_eq!(says(1.0, 1.1), "10.0 % larger");
        assert_eq!(says(1.0, 0.9), "10.0 % smaller");
        assert_eq!(says(2.0, 0.5), "0.25 times as large");
        assert_eq!(says(42.0, 0.056), "0.0013 times as large");
        assert_eq!(says(0.0, 0.5), "not zero");
        assert_eq!(says(-1.0, 0.5), "not of that sign");
    }
}
