//! The example on the library's front page is the README's, too.

/// The lines of the example that readers see; `cargo test --doc` runs all of it.
fn example() -> String {
    let page = include_str!("../src/lib.rs").lines();
    let text = page.filter_map(|line| line.strip_prefix("//!"));
    let text = text.map(|line| line.strip_prefix(' ').unwrap_or(line));
    let from_block = text.skip_while(|line| *line != "```").skip(1);
    let block = from_block.take_while(|line| *line != "```");
    let shown: Vec<&str> = block.filter(|line| !line.starts_with("# ")).collect();
    shown.join("\n")
}

#[test]
fn the_readme_shows_the_example_that_is_tested() {
    let block = format!("```rust\n{}\n```", example());
    assert!(block.lines().count() >= 10, "{block}");
    let page = include_str!("../README.md");
    assert!(page.contains(&block), "README.md lacks\n{block}");
}
