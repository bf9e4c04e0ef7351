/// A machine that warms up from the beginning of a log: its friction falls by a share.
#[derive(Debug, Clone, PartialEq)]
pub struct Warming {
    /// Share by which friction has fallen in the end.
    pub share: f64,
    /// Time constant \[s\].
    pub time: f64,
}

impl Warming {
    /// What is left of the friction at a time \[s\], as a share.
    pub fn left(&self, time: f64) -> f64 {
        1.0 - self.share * (1.0 - (-time / self.time).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::Warming;

    #[test]
    fn friction_falls_to_what_is_left_when_warm() {
        let warming = Warming {
            share: 0.4,
            time: 10.0,
        };
        assert_eq!(warming.left(0.0), 1.0);
        assert!((warming.left(1e3) - 0.6).abs() < 1e-12);
        assert!((warming.left(10.0) - (1.0 - 0.4 * 0.632_120_558)).abs() < 1e-9);
    }
}
