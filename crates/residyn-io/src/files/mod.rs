//! Files: written completely or not at all, found next to another file or embedded, identified by their contents.

mod fresh;
mod hash;
mod input;
mod named;
mod output;

pub use fresh::{FreshFolder, hidden_beside, locked, remove_folder};
pub use hash::{content_hash, content_id, sha256, sha256_of};
pub use input::{listed, open, read_saved, read_text, size};
pub use named::{beside, beside_or_named, text_or_embedded};
pub use output::{
    OutputError, check_room, end_of_links, folder_of, move_contents, write_whole, write_with,
};
