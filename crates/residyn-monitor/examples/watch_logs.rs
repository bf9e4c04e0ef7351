//! Logs of a machine under watch, the first of them healthy: `watch_logs MODEL HEALTHY-S LOG...`.

use residyn_core::model::Library;
use residyn_io::{read_log, read_model};
use residyn_monitor::{Monitor, Rows, Settings};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let model = read_model(&arguments[0], &Library::built_in()).expect("a model");
    let healthy_s = arguments[1].parse().expect("a number of seconds");
    let settings = Settings {
        healthy_s,
        ..Settings::default()
    };
    let mut monitor = Monitor::new(&model, settings).expect("a monitor");
    let mut time = 0.0;
    for path in &arguments[2..] {
        let log = read_log(path, &model).expect("a log");
        let mut rows = Rows::of_log(&log, model.measured_names()).expect("its columns");
        let from = time - rows.time[0];
        rows.time.iter_mut().for_each(|at| *at += from);
        println!("{path} from {time:.0} s");
        for alarm in monitor.update(&rows).expect("good rows") {
            println!("{:.0} s: {alarm}", alarm.time_s);
        }
        time = rows.time[rows.time.len() - 1] + 5.0;
    }
    print!("{}", monitor.summary());
}
