//! Files by their names: written whole or not at all, found beside another file or embedded, told apart by their contents.

mod hash;
mod named;
mod output;

pub use hash::{content_hash, content_id, sha256};
pub use named::{beside, beside_or_named, text_or_embedded};
pub use output::{OutputError, end_of_links, folder_of, move_contents, write_whole, write_with};
