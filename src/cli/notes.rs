//! Notes on a robot description, those alike said once: each of thirty joints has a range that no model carries.

use super::terminal;

/// Say them on standard error.
pub(super) fn say(notes: &[String]) {
    for (note, more) in alike(notes) {
        let more = match more {
            0 => String::new(),
            more => format!(" ({more} more like it, in the head of the model file)"),
        };
        terminal::say(format!("note: {note}{more}"));
    }
}

/// The first of the notes that differ in names and numbers alone, with how many others there are.
fn alike(notes: &[String]) -> Vec<(&str, usize)> {
    let mut groups: Vec<(&str, usize)> = Vec::new();
    for note in notes {
        match groups
            .iter_mut()
            .find(|(first, _)| shape(first) == shape(note))
        {
            Some((_, more)) => *more += 1,
            None => groups.push((note, 0)),
        }
    }
    groups
}

/// The words of a note that are neither names nor numbers.
fn shape(note: &str) -> Vec<&str> {
    let is_name =
        |word: &&str| word.contains(['`', '_']) || word.contains(|c: char| c.is_ascii_digit());
    note.split_whitespace()
        .filter(|word| !is_name(word))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::alike;

    #[test]
    fn notes_that_differ_in_names_and_numbers_are_said_once() {
        let notes = [
            "line 3: the range of `FL_hip`, -1 to 1, is not carried",
            "line 3: the velocity limit of `FL_hip` is not carried",
            "line 9: the range of `FR_hip`, -1.5 to 2e-1, is not carried",
            "line 1: contacts are not carried",
            "left out of joint FL_hip: damping 0.6, dry friction 0.2",
            "left out of joint FR_hip: damping 0.8, dry friction 0.2",
        ]
        .map(str::to_owned);
        let said = [
            (&*notes[0], 1),
            (&*notes[1], 0),
            (&*notes[3], 0),
            (&*notes[4], 1),
        ];
        assert_eq!(alike(&notes), said);
    }
}
