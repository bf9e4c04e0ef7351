//! Committed texts, which `tests/run --bless` rewrites.

use std::env;
use std::fs;
use std::path::Path;

/// Relative tolerance of a number. Answers in double precision are the same to the last digit with AVX-512 and with
/// AVX2 alone; processors that do not fuse a product and a sum, and other mathematics libraries, round differently.
const TOLERANCE: f64 = 1e-6;

/// Compare a text with a committed file, line by line, or write it there if `RESIDYN_BLESS` asks for it.
pub fn is_as_committed(path: &Path, found: &str, same: fn(&str, &str) -> bool) {
    let wanted = fs::read_to_string(path).unwrap_or_default();
    let Some(difference) = difference(&wanted, found, same) else {
        return;
    };
    if env::var_os("RESIDYN_BLESS").is_some() {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, found).unwrap();
        return;
    }
    panic!(
        "{}: {difference}\nWhere this is meant, `tests/run --bless` writes it anew.",
        path.display()
    );
}

/// The first line in which two texts differ.
pub fn difference(wanted: &str, found: &str, same: fn(&str, &str) -> bool) -> Option<String> {
    let (mut old, mut new) = (wanted.lines(), found.lines());
    for number in 1.. {
        match (old.next(), new.next()) {
            (None, None) => return None,
            (Some(a), Some(b)) if same(a, b) => (),
            (a, b) => {
                let [a, b] = [a, b].map(|line| line.unwrap_or("(the end)"));
                return Some(format!("line {number}\n  was {a}\n  is  {b}"));
            }
        }
    }
    unreachable!()
}

/// Whether two lines have the same words, and numbers that differ by no more than rounding.
pub fn same_but_for_rounding(wanted: &str, found: &str) -> bool {
    let (wanted, found) = (pieces(wanted), pieces(found));
    let alike = |(a, b): (&&str, &&str)| match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(a), Ok(b)) => (a - b).abs() <= TOLERANCE * a.abs().max(b.abs()),
        _ => a == b,
    };
    wanted.len() == found.len() && wanted.iter().zip(&found).all(alike)
}

/// A line cut into numbers and the text between them. Digits of a name, as in `tau1`, are part of the name.
fn pieces(line: &str) -> Vec<&str> {
    let in_word = |c: char| c.is_alphanumeric() || ['_', '.', '+', '-'].contains(&c);
    let mut pieces = Vec::new();
    let mut rest = line;
    while let Some(first) = rest.chars().next() {
        let end = rest.find(|c| in_word(c) != in_word(first));
        let (piece, others) = rest.split_at(end.unwrap_or(rest.len()));
        pieces.push(piece);
        rest = others;
    }
    pieces
}
