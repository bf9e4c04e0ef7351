use serde_json::Value;

/// The first place, in order of keys, where two configurations differ, in words; `place` is the path so far, empty at the
/// top.
pub(super) fn first_difference(place: &str, saved: &Value, mine: &Value) -> Option<String> {
    if let (Value::Object(saved), Value::Object(mine)) = (saved, mine) {
        let keys = saved.keys().chain(mine.keys());
        return keys
            .filter_map(|key| {
                let place = match place {
                    "" => key.clone(),
                    place => format!("{place}.{key}"),
                };
                let of = |map: &serde_json::Map<String, Value>| {
                    map.get(key).cloned().unwrap_or(Value::Null)
                };
                first_difference(&place, &of(saved), &of(mine))
            })
            .next();
    }
    (saved != mine).then(|| format!("its `{place}` is {saved}, here it is {mine}"))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::first_difference;

    #[test]
    fn the_place_and_both_values_are_named() {
        let saved = json!({"seed": 1, "fit": {"epochs": 40, "integrator": "rk4"}});
        assert_eq!(first_difference("run", &saved, &saved), None);
        let mine = json!({"seed": 1, "fit": {"epochs": 50, "integrator": "rk4"}});
        assert_eq!(
            first_difference("run", &saved, &mine).unwrap(),
            "its `run.fit.epochs` is 40, here it is 50"
        );
        let more = json!({"seed": 1, "fit": {"epochs": 40, "integrator": "rk4"}, "from": 3});
        assert_eq!(
            first_difference("", &saved, &more).unwrap(),
            "its `from` is null, here it is 3"
        );
    }
}
