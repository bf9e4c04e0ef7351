use super::{Animation, Chain, animation, lengths_along, resampled};
use crate::film::strips::{Strip, StripLine};
use crate::{PlotError, Quantity};

/// Two links of 1 m that turn at different speeds.
fn acrobot(frames: usize, step_s: f64) -> Animation {
    let pose = |k: usize| {
        let time = step_s * k as f64;
        let (a, b) = (2.0 * time.sin(), 5.0 * (0.7 * time).sin());
        let elbow = [a.sin(), -a.cos()];
        vec![[0.0, 0.0], elbow, [elbow[0] + b.sin(), elbow[1] - b.cos()]]
    };
    let line = |label: &str, rate: f64| StripLine {
        label: label.into(),
        values: (1..frames)
            .map(|k| (rate * step_s * k as f64).cos())
            .collect(),
    };
    let strip = |name, unit, lines| Strip {
        quantity: Quantity::new(name, unit),
        lines,
    };
    Animation {
        title: "acrobot".into(),
        step_s,
        chains: vec![Chain {
            frames: (0..frames).map(pose).collect(),
        }],
        strips: vec![
            strip(
                "torque",
                "N m",
                vec![line("joint 1", 3.0), line("joint 2", 1.0)],
            ),
            strip("reward", "", vec![line("reward", 0.5)]),
        ],
    }
}

/// The key frames of each animated attribute.
fn keyframes(film: &str) -> Vec<usize> {
    let lists = film.split("values=\"").skip(1);
    lists
        .map(|list| list.split('"').next().unwrap().split(';').count())
        .collect()
}

#[test]
fn frames_are_kept_and_play_in_real_time() {
    let film = animation(&acrobot(51, 0.1)).unwrap();
    assert_eq!(keyframes(&film), [51, 51, 51], "trace, bars, joints");
    assert_eq!(film.matches("dur=\"5.000s\"").count(), 4, "and the cursor");
    assert_eq!(film.matches("repeatCount=\"indefinite\"").count(), 4);
}

#[test]
fn fast_frames_are_thinned_and_a_long_film_stays_small() {
    let film = animation(&acrobot(1001, 0.02)).unwrap();
    assert_eq!(keyframes(&film), [501, 501, 501]);
    assert_eq!(film.matches("dur=\"20.000s\"").count(), 4);
    assert!(film.len() < 150_000, "{} bytes", film.len());
}

#[test]
fn the_last_frame_stands_where_nothing_moves() {
    let film = animation(&acrobot(3, 0.5)).unwrap();
    let mut paths = film.split("<path");
    let bars = paths
        .find(|path| path.contains("attributeName=\"d\""))
        .unwrap();
    let attribute = |name: &str| {
        let after = bars.split(&format!(" {name}=\"")).nth(1).unwrap();
        after.split('"').next().unwrap()
    };
    let last = attribute("values").split(';').next_back();
    assert_eq!(last, Some(attribute("d")));
}

#[test]
fn all_that_moves_shares_one_clock() {
    let mut episode = acrobot(5, 0.1);
    episode.strips.clear();
    let film = animation(&episode).unwrap();
    assert_eq!(film.matches("<svg").count(), 1, "{film}");
}

#[test]
fn frames_between_frames_are_straight() {
    let frames: Vec<_> = (0..4).map(|k| vec![[f64::from(k), 0.0]]).collect();
    let shown: Vec<f64> = resampled(&frames, 3)
        .iter()
        .map(|points| points[0].0)
        .collect();
    assert_eq!(shown, [0.0, 1.5, 3.0]);
}

#[test]
fn a_metre_is_as_long_across_as_up() {
    let mut episode = acrobot(2, 1.0);
    episode.chains[0].frames = vec![vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]; 2];
    let film = animation(&episode).unwrap();
    let data = film
        .split("values=\"")
        .nth(2)
        .unwrap()
        .split(';')
        .next()
        .unwrap();
    let numbers: Vec<f64> = data
        .split(['M', 'L', ' '])
        .filter_map(|number| number.parse().ok())
        .collect();
    let (across, up) = (numbers[2] - numbers[0], numbers[3] - numbers[5]);
    assert!((across - up).abs() < 0.2 && across > 100.0, "{across} {up}");
}

#[test]
fn lengths_add_up() {
    assert_eq!(
        lengths_along(&[(0.0, 0.0), (3.0, 4.0), (3.0, 5.0)]),
        [0.0, 5.0, 6.0]
    );
}

#[test]
fn a_motion_that_diverges_ends_there() {
    let mut episode = acrobot(11, 0.1);
    episode.chains[0].frames[6][2][0] = f64::NAN;
    let film = animation(&episode).unwrap();
    assert_eq!(keyframes(&film), [6, 6, 6]);
    assert!(film.contains("not finite after 0.50 s") && !film.contains("NaN"));
}

#[test]
fn odd_episodes_are_drawn() {
    let single = acrobot(1, 0.02);
    let mut bare = acrobot(5, 0.02);
    bare.strips.clear();
    let mut unknown = acrobot(5, 0.02);
    unknown.strips[0].lines[0].values.fill(f64::NAN);
    let mut still = acrobot(5, 0.02);
    still.chains[0].frames = vec![vec![[0.0, 0.0]]; 5];
    for episode in [single, bare, unknown, still] {
        let film = animation(&episode).unwrap();
        assert!(!film.contains("NaN") && !film.contains("inf\""), "{film}");
    }
}

#[test]
fn nothing_to_show_and_uneven_chains_are_errors() {
    let mut empty = acrobot(5, 0.02);
    empty.chains.clear();
    assert!(matches!(animation(&empty), Err(PlotError::Empty { .. })));
    let mut uneven = acrobot(5, 0.02);
    uneven.chains[0].frames[3].pop();
    assert!(matches!(
        animation(&uneven),
        Err(PlotError::Uneven { chain: 1, .. })
    ));
    let mut short = acrobot(5, 0.02);
    let frames = short.chains[0].frames[..4].to_vec();
    short.chains.push(Chain { frames });
    assert!(matches!(
        animation(&short),
        Err(PlotError::Uneven { chain: 2, .. })
    ));
}
