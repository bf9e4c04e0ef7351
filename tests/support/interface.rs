//! The public items of a crate as its sources declare them. No stable tool lists them: rustdoc's JSON needs nightly.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use quote::{ToTokens, quote};
use syn::{
    Attribute, Field, Fields, ImplItem, Item, ItemEnum, ItemImpl, ItemMacro, ItemStruct, ItemTrait,
    ItemUse, TraitItem, Type, UseTree, Visibility,
};

/// Names of the modules from the crate's root, and of the item itself.
type Names = Vec<String>;

/// The declarations of a file.
#[derive(Default)]
struct Module {
    public_modules: Vec<String>,
    modules: BTreeSet<String>,
    /// Public items by their names, each with its fields or variants on lines of their own.
    items: BTreeMap<String, Vec<String>>,
    /// Aliases of items declared elsewhere: the name, the path, whether it is public.
    uses: Vec<(String, Names, bool)>,
    /// Types of `impl` blocks, and what each block adds to the interface.
    blocks: Vec<(Names, Vec<String>)>,
}

/// The modules of a crate by their paths.
#[derive(Default)]
struct Crate(BTreeMap<Names, Module>);

/// Every public item of the crate with this root, by its shortest path, with its parts below it.
pub fn interface(root: &Path) -> String {
    let mut sources = Crate::default();
    sources.read(root, Vec::new());
    let mut found = Public::default();
    sources.find_public(&Vec::new(), &mut found);
    let mut lines: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (item, paths) in &found.items {
        let (name, module) = item.split_last().unwrap();
        let path = shortest(paths);
        let mut whole = sources.0[module].items[name].clone();
        whole.extend(sources.added_to(item));
        lines.insert(path.join("::"), whole);
        for other in paths.iter().filter(|other| *other != path) {
            lines.insert(other.join("::"), vec![format!("= {}", path.join("::"))]);
        }
    }
    for (path, target) in found.of_others {
        lines.insert(path, vec![format!("= {target}")]);
    }
    let text = lines.into_iter().map(|(path, lines)| {
        let below: String = lines.iter().map(|line| format!("    {line}\n")).collect();
        format!("{path}\n{below}")
    });
    text.collect()
}

/// The items that users can reach.
#[derive(Default)]
struct Public {
    /// Items by place of declaration, with the paths under which users find them.
    items: BTreeMap<Names, BTreeSet<Names>>,
    /// Paths to items of other crates.
    of_others: BTreeMap<String, String>,
}

fn shortest(paths: &BTreeSet<Names>) -> &Names {
    let mut paths = paths.iter();
    let first = paths.next().unwrap();
    paths.fold(
        first,
        |best, path| if path.len() < best.len() { path } else { best },
    )
}

impl Crate {
    /// Read a module's file and those of its submodules.
    fn read(&mut self, file: &Path, at: Names) {
        let text = fs::read_to_string(file);
        let text = text.unwrap_or_else(|why| panic!("{}: {why}", file.display()));
        let module = Module::of(syn::parse_file(&text).unwrap().items);
        let folder = match file.file_stem().unwrap().to_str().unwrap() {
            "lib" | "mod" => file.parent().unwrap().to_owned(),
            stem => file.with_file_name(stem),
        };
        for name in &module.modules {
            let alone = folder.join(format!("{name}.rs"));
            let file = if alone.exists() {
                alone
            } else {
                folder.join(name).join("mod.rs")
            };
            self.read(&file, joined(&at, name));
        }
        self.0.insert(at, module);
    }

    /// Add the items that users find in a public module and its submodules.
    fn find_public(&self, at: &Names, found: &mut Public) {
        let module = &self.0[at];
        for name in module.items.keys() {
            let path = joined(at, name);
            found.items.entry(path.clone()).or_default().insert(path);
        }
        for (name, path, _) in module.uses.iter().filter(|(.., is_public)| *is_public) {
            let here = joined(at, name);
            if let Some(item) = self.resolved(at, path) {
                found.items.entry(item).or_default().insert(here);
            } else {
                found.of_others.insert(here.join("::"), path.join("::"));
            }
        }
        for name in &module.public_modules {
            self.find_public(&joined(at, name), found);
        }
    }

    /// The additions of all modules' `impl` blocks to an item, sorted.
    fn added_to(&self, item: &Names) -> BTreeSet<String> {
        let blocks = self.0.iter().flat_map(|(at, module)| {
            let blocks = module.blocks.iter();
            blocks.filter(move |(target, _)| self.resolved(at, target).as_ref() == Some(item))
        });
        blocks.flat_map(|(_, added)| added.clone()).collect()
    }

    /// The place of declaration of the public item that a path means in a module.
    fn resolved(&self, at: &Names, path: &[String]) -> Option<Names> {
        let module = self.0.get(at)?;
        let (first, rest) = path.split_first()?;
        match first.as_str() {
            "crate" => return self.resolved(&Vec::new(), rest),
            "self" => return self.resolved(at, rest),
            "super" => return self.resolved(&at[..at.len() - 1].to_vec(), rest),
            _ => (),
        }
        if rest.is_empty() && module.items.contains_key(first) {
            return Some(joined(at, first));
        }
        if !rest.is_empty() && module.modules.contains(first) {
            return self.resolved(&joined(at, first), rest);
        }
        let used = module
            .uses
            .iter()
            .find(|(name, path, _)| name == first && path != std::slice::from_ref(first));
        let (_, path, _) = used?;
        self.resolved(at, &[path, rest].concat())
    }
}

fn joined(at: &[String], name: &str) -> Names {
    [at, &[name.to_owned()]].concat()
}

impl Module {
    fn of(items: Vec<Item>) -> Self {
        let mut module = Self::default();
        for item in items {
            module.add(item);
        }
        module
    }

    fn add(&mut self, item: Item) {
        match item {
            Item::Mod(item) if !is_of_tests(&item.attrs) => {
                let name = item.ident.to_string();
                if is_public(&item.vis) {
                    self.public_modules.push(name.clone());
                }
                self.modules.insert(name);
            }
            Item::Use(ItemUse { tree, vis, .. }) => self.add_uses(&tree, &[], is_public(&vis)),
            Item::Impl(block) => self.add_block(block),
            Item::Macro(call) => self.items.extend(declared_by(&call)),
            Item::Fn(item) if is_public(&item.vis) => {
                self.insert(&item.sig.ident, item.sig.to_token_stream());
            }
            Item::Const(item) if is_public(&item.vis) => {
                let (name, kind) = (&item.ident, &item.ty);
                self.insert(name, quote!(const #name: #kind));
            }
            Item::Static(item) if is_public(&item.vis) => {
                let (name, kind) = (&item.ident, &item.ty);
                self.insert(name, quote!(static #name: #kind));
            }
            Item::Type(mut item) if is_public(&item.vis) => {
                item.attrs.clear();
                self.insert(&item.ident.clone(), item.to_token_stream());
            }
            Item::Struct(item) if is_public(&item.vis) => {
                self.items.insert(item.ident.to_string(), of_struct(item));
            }
            Item::Enum(item) if is_public(&item.vis) => {
                self.items.insert(item.ident.to_string(), of_enum(item));
            }
            Item::Trait(item) if is_public(&item.vis) => {
                self.items.insert(item.ident.to_string(), of_trait(item));
            }
            _ => (),
        }
    }

    fn insert(&mut self, name: &syn::Ident, declared: TokenStream) {
        self.items.insert(name.to_string(), vec![said(&declared)]);
    }

    fn add_uses(&mut self, tree: &UseTree, before: &[String], is_public: bool) {
        match tree {
            UseTree::Path(path) => {
                self.add_uses(
                    &path.tree,
                    &joined(before, &path.ident.to_string()),
                    is_public,
                );
            }
            UseTree::Group(group) => {
                for tree in &group.items {
                    self.add_uses(tree, before, is_public);
                }
            }
            UseTree::Name(name) => {
                let name = name.ident.to_string();
                self.uses
                    .push((name.clone(), joined(before, &name), is_public));
            }
            UseTree::Rename(renamed) => {
                let path = joined(before, &renamed.ident.to_string());
                self.uses
                    .push((renamed.rename.to_string(), path, is_public));
            }
            UseTree::Glob(_) => assert!(!is_public, "public names are listed one by one"),
        }
    }

    fn add_block(&mut self, mut block: ItemImpl) {
        let Type::Path(target) = &*block.self_ty else {
            return;
        };
        let target = target.path.segments.iter();
        let target: Names = target.map(|part| part.ident.to_string()).collect();
        block.attrs.clear();
        let is_of_trait = block.trait_.is_some();
        let methods = block.items.iter().filter_map(|item| match item {
            ImplItem::Fn(method) if is_public(&method.vis) => Some(said(&method.sig)),
            ImplItem::Const(item) if is_public(&item.vis) => {
                let (name, kind) = (&item.ident, &item.ty);
                Some(said(&quote!(const #name: #kind)))
            }
            _ => None,
        });
        let added = if is_of_trait {
            block.items.clear();
            vec![without_body(&block)]
        } else {
            methods.collect()
        };
        self.blocks.push((target, added));
    }
}

fn of_struct(mut item: ItemStruct) -> Vec<String> {
    item.attrs.retain(tells);
    item.semi_token = None;
    let fields = std::mem::replace(&mut item.fields, Fields::Unit);
    let mut lines = vec![said(&item).trim_end_matches(';').to_owned()];
    let (public, private): (Vec<Field>, Vec<Field>) =
        fields.into_iter().partition(|field| is_public(&field.vis));
    lines.extend(public.into_iter().map(|mut field| {
        field.attrs.clear();
        said(&field)
    }));
    if !private.is_empty() {
        lines.push("private fields".to_owned());
    }
    lines
}

fn of_enum(mut item: ItemEnum) -> Vec<String> {
    item.attrs.retain(tells);
    let variants = std::mem::take(&mut item.variants);
    let mut lines = vec![without_body(&item)];
    lines.extend(variants.into_iter().map(|mut variant| {
        variant.attrs.clear();
        for field in &mut variant.fields {
            field.attrs.clear();
        }
        said(&variant)
    }));
    lines
}

fn of_trait(mut item: ItemTrait) -> Vec<String> {
    item.attrs.clear();
    let items = std::mem::take(&mut item.items);
    let mut lines = vec![without_body(&item)];
    lines.extend(items.into_iter().map(|item| match item {
        TraitItem::Fn(method) => said(&method.sig),
        TraitItem::Type(mut item) => {
            item.attrs.clear();
            said(&item)
        }
        TraitItem::Const(mut item) => {
            item.attrs.clear();
            said(&item)
        }
        other => said(&other),
    }));
    lines
}

/// The declaration by `name! { Type { field: Kind = value, .. } }`: a struct of that name.
fn declared_by(call: &ItemMacro) -> Option<(String, Vec<String>)> {
    let is_name = |token: &TokenTree| matches!(token, TokenTree::Ident(_));
    let mut tokens = call.mac.tokens.clone().into_iter();
    let name = tokens.find(is_name)?.to_string();
    let Some(TokenTree::Group(fields)) = tokens.next() else {
        return None;
    };
    if fields.delimiter() != Delimiter::Brace || call.ident.is_some() {
        return None;
    }
    let maker = call.mac.path.to_token_stream();
    let mut lines = vec![format!("{maker}! {name}")];
    let mut field = TokenStream::new();
    let mut tokens = fields.stream().into_iter();
    while let Some(token) = tokens.next() {
        match token.to_string().as_str() {
            // An attribute; its brackets come next.
            "#" => drop(tokens.next()),
            "," => lines.push(said(&std::mem::take(&mut field))),
            _ => field.extend([token]),
        }
    }
    Some((name, lines))
}

fn is_public(visibility: &Visibility) -> bool {
    matches!(visibility, Visibility::Public(_))
}

fn is_of_tests(attributes: &[Attribute]) -> bool {
    let mut attributes = attributes.iter().map(said);
    attributes.any(|attribute| attribute == "#[cfg(test)]")
}

/// Whether an attribute is part of the interface.
fn tells(attribute: &Attribute) -> bool {
    ["derive", "non_exhaustive"]
        .iter()
        .any(|name| attribute.path().is_ident(name))
}

/// The code before an empty body.
fn without_body(code: &impl ToTokens) -> String {
    said(code).trim_end_matches("{ }").trim_end().to_owned()
}

/// Code on one line, spaced roughly as rustfmt does.
fn said(code: &impl ToTokens) -> String {
    let mut line = code.to_token_stream().to_string();
    for (from, to) in [
        ("\n", " "),
        (" :: ", "::"),
        (":: ", "::"),
        (" ::", "::"),
        (" ,", ","),
        (" ;", ";"),
        (" :", ":"),
        (" (", "("),
        ("( ", "("),
        (" )", ")"),
        ("[ ", "["),
        (" ]", "]"),
        (" <", "<"),
        ("< ", "<"),
        (" >", ">"),
        ("& ", "&"),
        ("# ", "#"),
        ("- ", "-"),
        ("' ", "'"),
        (" ?", "?"),
        ("-> ", "-> "),
        ("->", " ->"),
        (",)", ")"),
        (",>", ">"),
        (", }", " }"),
        ("* ", "*"),
        ("! ", "!"),
    ] {
        line = line.replace(from, to);
    }
    line.split_whitespace().collect::<Vec<_>>().join(" ")
}
