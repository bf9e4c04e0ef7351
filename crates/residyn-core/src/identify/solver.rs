use super::outcome::Termination;
use super::search::Search;

/// How a fit finds the minimum of its cost. [`LevenbergMarquardt`](super::LevenbergMarquardt) is the usual one; one of
/// your own moves a [`Search`] in the same way. This one takes full Gauss-Newton steps:
///
/// ```
/// use residyn_core::identify::{Search, Solver, Termination};
///
/// #[derive(Debug)]
/// struct GaussNewton;
///
/// impl Solver for GaussNewton {
///     fn solve(&self, search: &mut Search<'_>) -> Termination {
///         for _ in 0..20 {
///             let Some(step) = search.propose(&search.linearised(), 0.0) else {
///                 return Termination::Singular;
///             };
///             let (before, after) = (search.cost(), search.cost_of(&step));
///             if after > before {
///                 return Termination::NoDescent;
///             }
///             search.take(step, after);
///             search.end_step();
///             if before - after <= 1e-9 * before {
///                 return Termination::SmallDecrease;
///             }
///         }
///         Termination::StepLimit
///     }
/// }
///
/// use residyn_core::closeloop::{Request, close_loop};
/// # use residyn_core::data::Channels;
/// # use residyn_core::model::Library;
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let library = Library::built_in();
/// # let model = library.model("pendulum")?;
/// # let time: Vec<f64> = (0..400).map(|row| 0.01 * f64::from(row)).collect();
/// # let q = vec![time.iter().map(|t| 0.5 * (6.0 * t).sin()).collect()];
/// # let log = |name: &str| {
/// #     let (time, q) = (time.clone(), q.clone());
/// #     Channels { time, q, ..Channels::default() }.log(name)
/// # };
/// # let logs = vec![log("run1")?, log("run2")?];
/// let mut request = Request::of(&model, &library, logs);
/// request.solver = &GaussNewton;
/// # let rng = &mut residyn_core::rng(0);
/// let outcome = close_loop(request, rng, &())?;
/// # Ok(())
/// # }
/// ```
pub trait Solver: std::fmt::Debug + Sync {
    /// Move the search to a minimum, and say why it ended.
    fn solve(&self, search: &mut Search<'_>) -> Termination;
}
