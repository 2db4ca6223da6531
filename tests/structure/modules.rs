//! The modules of a crate by its sources, and the files that name items of each.
//!
//! An edge A -> B: code of A outside of tests names an item that B defines, by a `use` or by a path. A name is
//! followed through re-exports to the file that defines it, else to the module that should have it. Declaring a
//! module or importing one is no edge; re-exporting an item is. Methods are not followed.

use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    fs,
    path::{Path, PathBuf},
};

type Names = Vec<String>;

/// A module: its file, and the items that it defines, imports and names.
#[derive(Default)]
struct Module {
    file: PathBuf,
    items: BTreeSet<String>,
    imports: HashMap<String, Names>,
    globs: Vec<Names>,
    paths: BTreeSet<Names>,
    words: BTreeSet<String>,
}

/// The target of a path.
enum Target {
    Module(Names),
    Item(PathBuf),
}

/// The modules of one crate, by their paths from its root.
#[derive(Default)]
pub(super) struct Crate(BTreeMap<Names, Module>);

type Edges<'a> = BTreeMap<&'a Path, BTreeSet<PathBuf>>;

/// The files that `from` names, directly or by way of others.
fn reached<'a>(edges: &'a Edges<'_>, from: &'a Path) -> BTreeSet<&'a Path> {
    let mut reached = BTreeSet::new();
    let mut ahead = vec![from];
    while let Some(file) = ahead.pop() {
        let next = edges.get(file).into_iter().flatten();
        ahead.extend(next.map(|it| &**it).filter(|it| reached.insert(*it)));
    }
    reached
}

/// Words, `::` and single characters, without comments, strings, characters and lifetimes.
pub(super) fn tokens(source: &str) -> Names {
    let text: Vec<char> = source.chars().collect();
    let starts =
        |at: usize, what: &str| what.chars().enumerate().all(|(i, c)| text.get(at + i) == Some(&c));
    let mut tokens: Names = Vec::new();
    let mut at = 0;
    while at < text.len() {
        let start = at;
        if starts(at, "//") {
            while at < text.len() && text[at] != '\n' {
                at += 1;
            }
        } else if starts(at, "/*") {
            at += 2;
            while at < text.len() && !starts(at, "*/") {
                at += 1;
            }
            at += 2;
        } else if text[at].is_alphanumeric() || text[at] == '_' {
            while at < text.len() && (text[at].is_alphanumeric() || text[at] == '_') {
                at += 1;
            }
            let word: String = text[start..at].iter().collect();
            let hashes = text[at..].iter().take_while(|c| **c == '#').count();
            if ["r", "br"].contains(&&*word) && text.get(at + hashes) == Some(&'"') {
                let end = format!("\"{}", "#".repeat(hashes));
                at += hashes + 1;
                while at < text.len() && !starts(at, &end) {
                    at += 1;
                }
                at += end.len();
            } else {
                tokens.push(word);
            }
        } else if text[at] == '"' {
            at += 1;
            while at < text.len() && text[at] != '"' {
                at += 1 + usize::from(text[at] == '\\');
            }
            at += 1;
        } else if text[at] == '\'' {
            // A character ends with a quote, a lifetime does not.
            at = match (text.get(at + 1), text.get(at + 2)) {
                (Some('\\'), _) => {
                    at + 4 + text[at + 3..].iter().take_while(|c| **c != '\'').count()
                }
                (_, Some('\'')) => at + 3,
                _ => at + 1,
            };
        } else {
            at += if starts(at, "::") { 2 } else { 1 };
            if !text[start].is_whitespace() {
                tokens.push(text[start..at].iter().collect());
            }
        }
    }
    tokens
}

/// The index of the bracket that closes the one at `open`.
fn closing(tokens: &[String], open: usize) -> usize {
    let mut depth = 0;
    for (at, token) in tokens.iter().enumerate().skip(open) {
        depth += match &**token {
            "{" | "(" | "[" => 1,
            "}" | ")" | "]" => -1,
            _ => 0,
        };
        if depth == 0 {
            return at;
        }
    }
    tokens.len() - 1
}

/// The index after the item at `at`, its attributes included.
fn past_item(tokens: &[String], mut at: usize) -> usize {
    while tokens[at] == "#" {
        at = closing(tokens, at + 1) + 1;
    }
    let import = tokens[at] == "use"
        || tokens[at] == "pub" && tokens.get(at + 1).is_some_and(|next| next == "use");
    while at < tokens.len() && tokens[at] != ";" {
        match &*tokens[at] {
            "{" if !import => return closing(tokens, at) + 1,
            "{" | "(" | "[" => at = closing(tokens, at) + 1,
            _ => at += 1,
        }
    }
    at + 1
}

/// The leaves of a `use` tree: each a path and the name it is imported by.
fn leaves(tokens: &[String], prefix: &[String], found: &mut Vec<(Names, String)>) {
    let mut at = 0;
    while at < tokens.len() {
        let mut path = prefix.to_vec();
        let mut name = None;
        while at < tokens.len() && tokens[at] != "," {
            match &*tokens[at] {
                "::" => at += 1,
                "{" => {
                    let end = closing(tokens, at);
                    leaves(&tokens[at + 1..end], &path, found);
                    (path, at) = (Vec::new(), end + 1);
                }
                "as" => {
                    name = tokens.get(at + 1).cloned();
                    at += 2;
                }
                "self" if !path.is_empty() => at += 1,
                word => {
                    path.push(word.to_owned());
                    at += 1;
                }
            }
        }
        if let Some(last) = path.last().cloned() {
            found.push((path, name.unwrap_or(last)));
        }
        at += 1;
    }
}

impl Crate {
    /// Read the crate whose root is `file`.
    pub(super) fn read(file: &Path) -> Self {
        let mut read = Self::default();
        let folder = file.parent().unwrap();
        read.read_file(file, folder, Vec::new());
        read
    }

    /// Read `file` as `module`, whose own modules are in `folder`.
    fn read_file(&mut self, file: &Path, folder: &Path, module: Names) {
        let source =
            fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        self.read_module(&tokens(&source), file, folder, module);
    }

    fn read_module(&mut self, tokens: &[String], file: &Path, folder: &Path, name: Names) {
        let mut module = Module { file: file.to_owned(), ..Module::default() };
        let word = |at: usize| tokens.get(at).map_or("", |token| &**token);
        let is_word = |at: usize| word(at).starts_with(|c: char| c.is_alphabetic() || c == '_');
        let (mut at, mut depth) = (0, 0);
        while at < tokens.len() {
            match word(at) {
                "#" if word(at + 1) == "[" && word(at + 2) == "cfg" => {
                    let end = closing(tokens, at + 1);
                    let condition = &tokens[at + 4..end];
                    let is_test = condition[0] == "test"
                        || condition[0] == "all" && condition.iter().any(|it| it == "test");
                    at = if is_test { past_item(tokens, end + 1) } else { end + 1 };
                    continue;
                }
                "{" => depth += 1,
                "}" => depth -= 1,
                "mod" if word(at + 2) == ";" || word(at + 2) == "{" => {
                    let child = word(at + 1).to_owned();
                    let path = [&name[..], std::slice::from_ref(&child)].concat();
                    if word(at + 2) == ";" {
                        let flat = folder.join(format!("{child}.rs"));
                        let file =
                            if flat.exists() { flat } else { folder.join(&child).join("mod.rs") };
                        self.read_file(&file, &folder.join(&child), path);
                        at += 3;
                    } else {
                        let end = closing(tokens, at + 2);
                        self.read_module(&tokens[at + 3..end], file, &folder.join(&child), path);
                        at = end + 1;
                    }
                    continue;
                }
                "use" if word(at + 1) != "<" => {
                    let end = at + tokens[at..].iter().position(|token| token == ";").unwrap();
                    let mut found = Vec::new();
                    leaves(&tokens[at + 1..end], &[], &mut found);
                    for (mut path, alias) in found {
                        if alias == "*" {
                            path.pop();
                            module.globs.push(path);
                        } else {
                            module.paths.insert(path.clone());
                            module.imports.insert(alias, path);
                        }
                    }
                    at = end;
                }
                "fn" | "struct" | "enum" | "union" | "trait" | "type" | "const" | "static"
                    if depth == 0 && is_word(at + 1) =>
                {
                    let name = if word(at + 1) == "mut" { at + 2 } else { at + 1 };
                    module.items.insert(word(name).to_owned());
                }
                // The arguments of a macro may define items at the top of its braces.
                "!" if depth == 0 && word(at + 1) == "{" => {
                    let (mut inner, end) = (at + 2, closing(tokens, at + 1));
                    while inner < end {
                        if word(inner).starts_with(char::is_uppercase) && word(inner + 1) == "," {
                            module.items.insert(word(inner).to_owned());
                        }
                        let opens = ["{", "(", "["].contains(&word(inner));
                        inner = if opens { closing(tokens, inner) } else { inner } + 1;
                    }
                }
                "!" if word(at.wrapping_sub(1)) == "macro_rules" => {
                    module.items.insert(word(at + 1).to_owned());
                }
                _ if is_word(at) && word(at.wrapping_sub(1)) != "::" => {
                    let mut path = vec![word(at).to_owned()];
                    while word(at + 1) == "::" && is_word(at + 2) {
                        path.push(word(at + 2).to_owned());
                        at += 2;
                    }
                    if path.len() > 1 {
                        module.paths.insert(path);
                    } else {
                        module.words.extend(path);
                    }
                }
                _ => {}
            }
            at += 1;
        }
        self.0.insert(name, module);
    }

    /// The target of `path` in the module `from`; none if it is outside the crate.
    fn resolve(&self, from: &[String], path: &[String], depth: usize) -> Option<Target> {
        let (first, rest) = path.split_first()?;
        let mut here = match &**first {
            "crate" => Vec::new(),
            "self" => from.to_vec(),
            "super" => from[..from.len().checked_sub(1)?].to_vec(),
            _ => match self.member(from, first, depth)? {
                Target::Module(module) => module,
                item @ Target::Item(_) => return Some(item),
            },
        };
        for name in rest {
            if name == "super" {
                here.pop()?;
                continue;
            }
            match self.member(&here, name, depth) {
                Some(Target::Module(module)) => here = module,
                Some(item) => return Some(item),
                None => return Some(Target::Item(self.0[&here].file.clone())),
            }
        }
        Some(Target::Module(here))
    }

    /// The target of `name` in `module`.
    fn member(&self, module: &[String], name: &String, depth: usize) -> Option<Target> {
        let child = [module, std::slice::from_ref(name)].concat();
        let it = self.0.get(module)?;
        if self.0.contains_key(&child) {
            Some(Target::Module(child))
        } else if it.items.contains(name) {
            Some(Target::Item(it.file.clone()))
        } else if depth == 0 {
            None
        } else if let Some(path) = it.imports.get(name) {
            // `use rand::rand` names another crate, not itself.
            (path.first() != Some(name)).then(|| self.resolve(module, path, depth - 1))?
        } else {
            it.globs.iter().find_map(|glob| match self.resolve(module, glob, depth - 1)? {
                Target::Module(of) => self.member(&of, name, depth - 1),
                Target::Item(_) => None,
            })
        }
    }

    /// The edges from each file to the files whose items it names.
    fn edges(&self) -> Edges<'_> {
        let mut edges = BTreeMap::<_, BTreeSet<_>>::new();
        for (name, module) in &self.0 {
            let from_globs = module
                .words
                .iter()
                .filter(|word| !module.imports.contains_key(*word) && !module.globs.is_empty());
            let words = from_globs.map(std::slice::from_ref);
            for path in module.paths.iter().map(Vec::as_slice).chain(words) {
                if let Some(Target::Item(file)) = self.resolve(name, path, 8)
                    && file != module.file
                {
                    edges.entry(&*module.file).or_default().insert(file);
                }
            }
        }
        edges
    }

    /// Files that name each other, directly or by way of others; a line for each such group.
    pub(super) fn circles(&self) -> Vec<String> {
        let edges = self.edges();
        let all: BTreeMap<_, _> = edges.keys().map(|file| (*file, reached(&edges, file))).collect();
        let with = |file: &Path| {
            all[file]
                .iter()
                .filter(|it| all.get(**it).is_some_and(|back| back.contains(file)))
                .copied()
                .collect()
        };
        let groups: BTreeSet<BTreeSet<&Path>> = all
            .keys()
            .map(|file| with(file))
            .filter(|group: &BTreeSet<_>| !group.is_empty())
            .collect();
        let line = |group: &BTreeSet<&Path>| {
            let arrows = group.iter().map(|file| {
                let inside: Vec<_> = edges[file]
                    .iter()
                    .filter(|to| group.contains(&***to))
                    .map(|to| to.display().to_string())
                    .collect();
                format!("\n  {} -> {}", file.display(), inside.join(", "))
            });
            format!("a circle of {} files:{}", group.len(), arrows.collect::<String>())
        };
        groups.iter().map(line).collect()
    }
}
