#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Columns {
    pub time: String,
    pub q: Vec<String>,
    pub qd: Vec<String>,
    pub tau: Vec<String>,
}
impl Columns {
    pub fn standard(n: usize) -> Self {
        let c = |s: &str| (1..=n).map(|j| format!("{s}{j}")).collect();
        Self {
            time: "time".into(),
            q: c("q"),
            qd: c("qd"),
            tau: c("tau"),
        }
    }
}
