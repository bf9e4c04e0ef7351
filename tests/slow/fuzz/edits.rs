//! Inputs that are nearly valid files: seeds with a few edits.

use std::ops::Range;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Largest length of an input \[bytes\].
const MOST: usize = 1 << 20;

/// Delimiters in texts of all formats, and some that only look like delimiters.
const PAIRS: [(&str, &str); 25] = [
    ("(", ")"),
    ("[", "]"),
    ("{", "}"),
    ("{a=", "}"),
    ("{\"a\":", "}"),
    ("[[", "]]"),
    ("<a>", "</a>"),
    ("<a b:c='d' xmlns:b='e'>", "</a>"),
    ("<body>", "</body>"),
    ("<link name=\"", "\"/>"),
    ("<!--", "-->"),
    ("<![CDATA[", "]]>"),
    ("<!DOCTYPE a [<!ENTITY b \"", "\">]>&b;"),
    ("\"", "\""),
    ("'''", "'''"),
    ("sin(", ")"),
    ("max(1,", ")"),
    ("clamp(q1,", ",2)"),
    ("where(q1<0,", ",2)"),
    ("-", ""),
    ("q1^", ""),
    ("a.", ""),
    ("\\", ""),
    ("+", "*"),
    ("#", "\n"),
];

/// Words that may stand in place of a number or a name, and elsewhere.
const WORDS: &str = "0 -0.0 1 -1 2 255 65536 4294967296 9007199254740993 9223372036854775807 \
    18446744073709551616 1e-320 1e308 1e309 -1e308 1e30 0.1e-3000000000 nan -inf inf NaN null true \
    \"\" '' [] {} 1979-05-27T07:32:00Z 0x7f 1_000 1. .5 q1 qd1 tau1 t q13 w1 \u{feff} \u{200b} \
    a\u{301}\u{301} \u{1f9be} \u{202e} &lt; &#x0; \0";

/// Lengths, counts and offsets that go wrong.
const WHOLE: [u64; 18] = [
    0,
    1,
    2,
    7,
    127,
    128,
    255,
    256,
    32_767,
    65_535,
    65_536,
    1 << 20,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    1 << 32,
    0x7fff_ffff_ffff_ffff,
    u64::MAX,
];

/// How the files of a format are encoded.
#[derive(Clone, Copy)]
pub enum Form {
    Text,
    Bytes,
}

/// One of the seeds after some edits: mostly few, since the unchanged parts are read further.
pub fn edited(form: Form, seeds: &[Vec<u8>], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut editor = Editor { seeds, rng };
    let mut input = editor.seed().to_vec();
    let most = 1 << editor.rng.random_range(0..4);
    for _ in 0..editor.rng.random_range(1..=most) {
        match form {
            Form::Text => editor.edit_text(&mut input),
            Form::Bytes => editor.edit_bytes(&mut input),
        }
        input.truncate(MOST);
    }
    input
}

struct Editor<'a> {
    seeds: &'a [Vec<u8>],
    rng: &'a mut ChaCha8Rng,
}

impl<'a> Editor<'a> {
    fn edit_text(&mut self, input: &mut Vec<u8>) {
        match self.rng.random_range(0..16) {
            0..4 => {
                let (word, other) = (self.around(input, is_of_word), self.word());
                input.splice(word, other);
            }
            4 => {
                let (at, word) = (self.place(input), self.word());
                input.splice(at..at, word);
            }
            5 => {
                let line = self.around(input, is_of_line);
                input.drain(line);
            }
            6..8 => {
                let seed = self.seed();
                let line = self.lines(seed);
                let at = self.around(input, is_of_line).start;
                input.splice(at..at, line);
            }
            8 => {
                let line = self.lines(input);
                let at = self.around(input, is_of_line).start;
                input.splice(at..at, line);
            }
            9 => self.repeat_numbered(input),
            10..12 => self.nest(input),
            12 => self.repeat(input),
            13 => {
                let part = self.part(input);
                input.drain(part);
            }
            _ => self.edit_bytes(input),
        }
    }

    fn edit_bytes(&mut self, input: &mut Vec<u8>) {
        let part = self.part(input);
        match self.rng.random_range(0..16) {
            0..4 => {
                let bit = 1 << self.rng.random_range(0..8);
                input[part.start..]
                    .iter_mut()
                    .take(1)
                    .for_each(|byte| *byte ^= bit);
            }
            4..9 => {
                let whole = self.whole();
                overwrite(&mut input[part.start..], &whole);
            }
            9 => drop(input.drain(part)),
            10 => {
                let (copied, at) = (input[part].to_vec(), self.place(input));
                overwrite(&mut input[at..], &copied);
            }
            11 => self.rng.fill(&mut input[part]),
            12 => self.repeat(input),
            13 => input.truncate(part.start),
            14 => {
                let seed = self.seed();
                let tail = &seed[self.place(seed)..];
                input.splice(part.start.., tail.iter().copied());
            }
            _ => {
                let value = self.rng.random();
                input[part].fill(value);
            }
        }
    }

    /// Repeat a part many times.
    fn repeat(&mut self, input: &mut Vec<u8>) {
        let part = self.part(input);
        let copied = input[part.clone()].to_vec();
        let times = self.times(copied.len());
        input.splice(part, copied.repeat(times));
    }

    /// Repeat some lines or a part many times, a word of them with a number in each.
    fn repeat_numbered(&mut self, input: &mut Vec<u8>) {
        let (at, copied) = match self.rng.random() {
            true => (self.around(input, is_of_line).start, self.lines(input)),
            false => {
                let part = self.part(input);
                (part.end, input[part].to_vec())
            }
        };
        let word = self.around(&copied, is_of_word).end;
        let mut all = Vec::new();
        for number in 0..self.times(copied.len() + 4) {
            all.extend_from_slice(&copied[..word]);
            all.extend_from_slice(number.to_string().as_bytes());
            all.extend_from_slice(&copied[word..]);
        }
        input.splice(at..at, all);
    }

    /// Put many pairs around a part.
    fn nest(&mut self, input: &mut Vec<u8>) {
        let (open, close) = PAIRS[self.rng.random_range(0..PAIRS.len())];
        let times = self.times(open.len() + close.len());
        let part = match self.rng.random() {
            true => self.part(input),
            false => self.around(input, is_of_word),
        };
        input.splice(part.end..part.end, close.repeat(times).into_bytes());
        input.splice(part.start..part.start, open.repeat(times).into_bytes());
    }

    /// How often a part of this length is repeated: seldom up to the longest input.
    fn times(&mut self, length: usize) -> usize {
        let most = match self.rng.random_range(0..150) {
            0 => 20,
            1..10 => 11,
            _ => 5,
        };
        let times = 1 << self.rng.random_range(0..=most);
        (times + self.rng.random_range(0..times)).min(MOST / length.max(1))
    }

    fn seed(&mut self) -> &'a [u8] {
        &self.seeds[self.rng.random_range(0..self.seeds.len())]
    }

    fn place(&mut self, input: &[u8]) -> usize {
        self.rng.random_range(0..=input.len())
    }

    /// A part, mostly short.
    fn part(&mut self, input: &[u8]) -> Range<usize> {
        let start = self.place(input);
        let longest = 1_usize << self.rng.random_range(0..12);
        start..input.len().min(start + self.rng.random_range(0..=longest))
    }

    /// The bytes of one kind around a place.
    fn around(&mut self, input: &[u8], is_of: fn(&u8) -> bool) -> Range<usize> {
        let at = self.place(input);
        let before = input[..at]
            .iter()
            .rev()
            .take_while(|byte| is_of(byte))
            .count();
        let behind = input[at..].iter().take_while(|byte| is_of(byte)).count();
        at - before..at + behind
    }

    /// Some whole lines.
    fn lines(&mut self, input: &[u8]) -> Vec<u8> {
        let start = self.around(input, is_of_line).start;
        let most = 1 << self.rng.random_range(0..4);
        let count = self.rng.random_range(1..=most);
        let lines = input[start..].split_inclusive(|byte| *byte == b'\n');
        lines.take(count).flatten().copied().collect()
    }

    /// One of the words, or a word of a seed.
    fn word(&mut self) -> Vec<u8> {
        match self.rng.random() {
            true => {
                let words: Vec<&str> = WORDS.split(' ').collect();
                words[self.rng.random_range(0..words.len())].into()
            }
            false => {
                let seed = self.seed();
                seed[self.around(seed, is_of_word)].to_vec()
            }
        }
    }

    /// A whole number in one of the widths and byte orders, or a number close to it.
    fn whole(&mut self) -> Vec<u8> {
        let near = self.rng.random_range(0..3_u64);
        let value = WHOLE[self.rng.random_range(0..WHOLE.len())].wrapping_sub(near);
        let width = 1 << self.rng.random_range(0..4);
        let mut bytes = value.to_le_bytes()[..width].to_vec();
        if self.rng.random_range(0..4) == 0 {
            bytes.reverse();
        }
        bytes
    }
}

fn is_of_word(byte: &u8) -> bool {
    byte.is_ascii_alphanumeric() || b"_.-+".contains(byte) || !byte.is_ascii()
}

fn is_of_line(byte: &u8) -> bool {
    *byte != b'\n'
}

/// Overwrites the bytes that begin there, up to the end of the input.
fn overwrite(input: &mut [u8], bytes: &[u8]) {
    let length = input.len().min(bytes.len());
    input[..length].copy_from_slice(&bytes[..length]);
}
