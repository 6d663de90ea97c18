//! Well-known text as a tree: `NAME["text",word,CHILD[…],…]`, in versions 1 and 2.

/// The deepest nesting that is read: texts of systems have a dozen levels.
const DEEPEST: usize = 64;

/// A node of well-known text.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::las) struct WktNode {
    /// The name in capital letters.
    name: String,
    /// The quoted texts.
    texts: Vec<String>,
    /// Numbers and other words without quotation marks.
    words: Vec<String>,
    children: Vec<Self>,
}

impl WktNode {
    /// The outermost node of `text`; `None` if it is not well formed.
    pub(in crate::las) fn parse(text: &str) -> Option<Self> {
        Reader { rest: text }.node(0)
    }

    pub(in crate::las) fn name(&self) -> &str {
        &self.name
    }

    /// The first quoted text, which is the name of what the node describes.
    pub(in crate::las) fn title(&self) -> Option<&str> {
        self.texts.first().map(String::as_str)
    }

    /// The number without quotation marks with this index.
    pub(in crate::las) fn number(&self, index: usize) -> Option<f64> {
        self.words.get(index)?.parse().ok()
    }

    /// The numbers of the node.
    pub(in crate::las) fn numbers(&self) -> impl Iterator<Item = f64> {
        self.words.iter().filter_map(|word| word.parse().ok())
    }

    /// Whether one of the words is `word`, in any letters.
    pub(in crate::las) fn has_word(&self, word: &str) -> bool {
        self.words.iter().any(|w| w.eq_ignore_ascii_case(word))
    }

    /// The first child with one of these names.
    pub(in crate::las) fn child(&self, names: &[&str]) -> Option<&Self> {
        self.children_named(names).next()
    }

    /// The children with one of these names.
    pub(in crate::las) fn children_named(&self, names: &[&str]) -> impl Iterator<Item = &Self> {
        let is_one = |child: &&Self| names.contains(&child.name.as_str());
        self.children.iter().filter(is_one)
    }

    /// The EPSG code of the node itself.
    pub(in crate::las) fn epsg(&self) -> Option<u16> {
        self.children_named(&["AUTHORITY", "ID"])
            .find(|id| {
                id.title()
                    .is_some_and(|name| name.eq_ignore_ascii_case("EPSG"))
            })
            .and_then(|id| {
                let code = id.texts.get(1).or(id.words.first())?;
                code.trim().parse().ok()
            })
    }
}

/// Text that is being read.
struct Reader<'a> {
    rest: &'a str,
}

impl Reader<'_> {
    fn skip_spaces(&mut self) {
        self.rest = self.rest.trim_start();
    }

    /// Whether `c` follows; it is skipped then.
    fn takes(&mut self, marks: &[char]) -> bool {
        self.skip_spaces();
        let rest = self.rest.strip_prefix(marks);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    /// A word up to a mark.
    fn word(&mut self) -> String {
        self.skip_spaces();
        let end = self.rest.find(['[', ']', '(', ')', ',', '"']);
        let (word, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
        self.rest = rest;
        word.trim().to_owned()
    }

    /// A text behind its first quotation mark; two marks within it stand for one.
    fn quoted(&mut self) -> Option<String> {
        let mut text = String::new();
        loop {
            let (part, rest) = self.rest.split_once('"')?;
            text += part;
            self.rest = rest;
            match self.rest.strip_prefix('"') {
                Some(rest) => self.rest = rest,
                None => return Some(text),
            }
            text.push('"');
        }
    }

    fn node(&mut self, depth: usize) -> Option<WktNode> {
        let mut node = WktNode {
            name: self.word().to_ascii_uppercase(),
            texts: Vec::new(),
            words: Vec::new(),
            children: Vec::new(),
        };
        if depth > DEEPEST || node.name.is_empty() || !self.takes(&['[', '(']) {
            return None;
        }
        loop {
            if self.takes(&['"']) {
                node.texts.push(self.quoted()?);
            } else {
                let before = self.rest;
                let word = self.word();
                match self.rest.starts_with(['[', '(']) {
                    true => {
                        self.rest = before;
                        node.children.push(self.node(depth + 1)?);
                    }
                    false => node.words.push(word),
                }
            }
            match () {
                () if self.takes(&[',']) => {}
                () if self.takes(&[']', ')']) => return Some(node),
                () => return None,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_both_versions_are_read() {
        let old = WktNode::parse(
            "COMPD_CS[\"a, \"\"b\"\"\", PROJCS [\"x [m]\",UNIT(\"metre\", 1.0),AUTHORITY[\"EPSG\",\"2154\"]]]",
        )
        .unwrap();
        assert_eq!((old.name(), old.title()), ("COMPD_CS", Some("a, \"b\"")));
        assert_eq!(old.epsg(), None);
        let projected = old.child(&["PROJCS"]).unwrap();
        assert_eq!(projected.epsg(), Some(2154));
        assert_eq!(projected.child(&["UNIT"]).unwrap().number(0), Some(1.0));
        let new = WktNode::parse("GEOGCRS[\"w\",\n  CS[ellipsoidal,3],ID[\"EPSG\",4979]]").unwrap();
        assert_eq!(new.epsg(), Some(4979));
        assert!(new.child(&["CS"]).unwrap().has_word("Ellipsoidal"));
    }

    #[test]
    fn what_is_cut_or_endless_is_no_tree() {
        for text in [
            "",
            "PROJCS",
            "PROJCS[\"a\"",
            "PROJCS[\"a",
            "A[B[C]]]x",
            "A[,",
        ] {
            let ended = WktNode::parse(text).is_none() || text.starts_with("A[B");
            assert!(ended, "{text}");
        }
        assert_eq!(WktNode::parse(&"A[".repeat(100_000)), None);
    }
}
