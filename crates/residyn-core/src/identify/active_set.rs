use nalgebra::DVector;

/// The step of the unknowns `free` to the minimum of a quadratic cost, and those of them that stay free: unknowns that
/// a bound would stop are removed one after the other. `solve` gives the step of some unknowns, and `leaves` says
/// whether a step of the unknown at this place would leave its bounds. `None` if a step cannot be solved for.
pub fn step_within_bounds(
    mut free: Vec<usize>,
    solve: impl Fn(&[usize]) -> Option<DVector<f64>>,
    leaves: impl Fn(usize, f64) -> bool,
) -> Option<(Vec<usize>, DVector<f64>)> {
    loop {
        let step = solve(&free)?;
        let mut moves = free.iter().zip(step.iter());
        match moves.position(|(&unknown, &step)| leaves(unknown, step)) {
            Some(stopped) => free.remove(stopped),
            None => return Some((free, step)),
        };
    }
}
