use residyn_control::control::Task;
use residyn_formats::ExportedTask;

/// The built-in task of a system, for formats that have a reward: see [`ExportModel::with_task`](crate::formats::ExportModel).
pub fn exported_task(system: &str) -> Option<ExportedTask> {
    let task = Task::of_system(system)?;
    let mut start_spread = task.start_spread.clone();
    start_spread.resize(2 * task.joints(), 0.0);
    Some(ExportedTask {
        name: task.name(),
        reward: task.objective().program().clone(),
        about: task.about,
        objective: task.objective,
        torque: task.torque,
        start: task.start,
        start_spread,
        steps: task.steps,
        step_s: task.step_s,
    })
}
