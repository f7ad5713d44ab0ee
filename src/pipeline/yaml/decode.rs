//! From the located tree to `serde` structures.
//!
//! This is a [`serde::Deserializer`] over [`Node`]: any structure that derives `Deserialize` is read, and whatever it
//! refuses comes back with the line of the node it refused and the path that led there. Two things are stricter than
//! `serde` by itself: a number must be finite, and a key without a value is refused instead of being
//! taken for an absent one. Structures must not use `serde(flatten)` or `serde(untagged)`: both read into a buffer
//! first, which knows no lines.

use serde::de::value::StrDeserializer;
use serde::de::{self, DeserializeSeed, Deserializer, IntoDeserializer, Visitor};
use serde::forward_to_deserialize_any;

use super::{Entry, Node, Problem, Segment, Value, describe};
use crate::text::number;

/// Reads a structure out of a tree.
pub fn decode<'de, T: de::Deserialize<'de>>(node: &'de Node) -> Result<T, Problem> {
    T::deserialize(Decoder(node))
}

#[derive(Clone, Copy)]
struct Decoder<'de>(&'de Node);

impl<'de> Decoder<'de> {
    fn refuse<T>(self, message: String) -> Result<T, Problem> {
        Err(Problem::new(message).or_at(self.0.origin))
    }

    fn expected<T>(self, what: &str) -> Result<T, Problem> {
        self.refuse(format!("expected {what}, found {}", describe(&self.0.value)))
    }

    fn visit<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Problem> {
        match &self.0.value {
            Value::Null => visitor.visit_unit(),
            Value::Bool(b) => visitor.visit_bool(*b),
            Value::Integer(i) => match (i64::try_from(*i), u64::try_from(*i)) {
                (Ok(i), _) => visitor.visit_i64(i),
                (_, Ok(u)) => visitor.visit_u64(u),
                _ => Err(Problem::new(format!("the number {i} is too large"))),
            },
            Value::Float(x) if x.is_finite() => visitor.visit_f64(*x),
            Value::Float(_) => {
                Err(Problem::new("expected a finite number, found an infinite one or not a number (NaN)"))
            }
            Value::Text(text) => visitor.visit_borrowed_str(text),
            Value::List(items) => {
                let mut entries = Items { items: items.iter(), next: 0 };
                let value = visitor.visit_seq(&mut entries)?;
                match entries.items.next() {
                    None => Ok(value),
                    Some(_) => Err(Problem::new(format!("expected {} entries, found {}", entries.next, items.len()))),
                }
            }
            Value::Map(entries) => visitor.visit_map(Entries { entries: entries.iter(), current: None }),
        }
    }
}

/// Where a whole number is wanted, `1e3` and `007` are whole numbers too.
macro_rules! whole {
    ($($name:ident)*) => {$(
        fn $name<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Problem> {
            match self.0.value {
                Value::Float(x) if x.is_finite() && x.fract() == 0.0 => match x.abs() < EXACT {
                    true => visitor.visit_i64(x as i64).map_err(|p: Problem| p.or_at(self.0.origin)),
                    false => self.refuse(format!("the number {} is too large", number(x))),
                },
                _ => self.deserialize_any(visitor),
            }
        }
    )*};
}

/// Up to here every whole number has a double of its own.
const EXACT: f64 = (1u64 << 53) as f64;

impl<'de> Deserializer<'de> for Decoder<'de> {
    type Error = Problem;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Problem> {
        self.visit(visitor).map_err(|p| p.or_at(self.0.origin))
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Problem> {
        match self.0.value {
            Value::Null => self.refuse("has no value; give it one, or take the key out".into()),
            _ => visitor.visit_some(self),
        }
    }

    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Problem> {
        match self.0.value {
            Value::Integer(i) => visitor.visit_f64(i as f64).map_err(|p: Problem| p.or_at(self.0.origin)),
            _ => self.deserialize_any(visitor),
        }
    }

    fn deserialize_f32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Problem> {
        self.deserialize_f64(visitor)
    }

    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Problem> {
        let shown = describe(&self.0.value);
        match self.0.value {
            Value::Bool(_) | Value::Integer(_) | Value::Float(_) => {
                self.refuse(format!("expected text, found {shown}; put it in quotes"))
            }
            _ => self.deserialize_any(visitor),
        }
    }

    fn deserialize_str<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Problem> {
        self.deserialize_string(visitor)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, _: &'static str, visitor: V) -> Result<V::Value, Problem> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Problem> {
        match self.0.value {
            Value::Map(_) => self.deserialize_any(visitor),
            _ => self.expected(&format!("a mapping (of {})", fields.join(", "))),
        }
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Problem> {
        let choice = match &self.0.value {
            Value::Text(word) => Choice { word, entry: None, node: self.0 },
            Value::Map(entries) => match entries.as_slice() {
                [entry] => Choice { word: &entry.key, entry: Some(entry), node: self.0 },
                _ => {
                    let found: Vec<&str> = entries.iter().map(|e| e.key.as_str()).collect();
                    let found = if found.is_empty() { "none".into() } else { found.join(", ") };
                    return self.refuse(format!("expected one key out of {}, found {found}", variants.join(", ")));
                }
            },
            _ => return self.expected(&format!("one of {}", variants.join(", "))),
        };
        visitor.visit_enum(choice).map_err(|p| p.or_at(self.0.origin))
    }

    whole! {
        deserialize_i8 deserialize_i16 deserialize_i32 deserialize_i64
        deserialize_u8 deserialize_u16 deserialize_u32 deserialize_u64
    }

    forward_to_deserialize_any! {
        bool i128 u128 char bytes byte_buf unit unit_struct seq tuple tuple_struct map identifier ignored_any
    }
}

struct Items<'de> {
    items: std::slice::Iter<'de, Node>,
    next: usize,
}

impl<'de> de::SeqAccess<'de> for Items<'de> {
    type Error = Problem;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Problem> {
        let Some(item) = self.items.next() else { return Ok(None) };
        let index = self.next;
        self.next += 1;
        seed.deserialize(Decoder(item)).map(Some).map_err(|p| p.or_at(item.origin).inside(Segment::Index(index)))
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.items.len())
    }
}

struct Entries<'de> {
    entries: std::slice::Iter<'de, Entry>,
    current: Option<&'de Entry>,
}

impl Entry {
    fn place(&self, problem: Problem, origin: super::Origin) -> Problem {
        problem.or_at(origin).inside(Segment::Key(self.key.clone()))
    }
}

impl<'de> de::MapAccess<'de> for Entries<'de> {
    type Error = Problem;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, Problem> {
        let Some(entry) = self.entries.next() else { return Ok(None) };
        self.current = Some(entry);
        let word: StrDeserializer<'de, Problem> = entry.key.as_str().into_deserializer();
        seed.deserialize(word).map(Some).map_err(|p| entry.place(p, entry.origin))
    }

    fn next_value_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<T::Value, Problem> {
        let Some(entry) = self.current.take() else { return Err(Problem::new("a value was asked for before its key")) };
        seed.deserialize(Decoder(&entry.value)).map_err(|p| entry.place(p, entry.value.origin))
    }
}

/// A variant of an enum: a word, or a mapping of one key.
struct Choice<'de> {
    word: &'de str,
    entry: Option<&'de Entry>,
    node: &'de Node,
}

impl<'de> Choice<'de> {
    fn content(&self, problem: Problem) -> Problem {
        match self.entry {
            Some(entry) => entry.place(problem, entry.value.origin),
            None => problem.or_at(self.node.origin),
        }
    }

    fn decoder(&self) -> Result<Decoder<'de>, Problem> {
        match self.entry {
            Some(entry) => Ok(Decoder(&entry.value)),
            None => {
                Err(Problem::new(format!("`{}` needs a value: `{}: ...`", self.word, self.word))
                    .or_at(self.node.origin))
            }
        }
    }
}

impl<'de> de::EnumAccess<'de> for Choice<'de> {
    type Error = Problem;
    type Variant = Self;

    fn variant_seed<V: DeserializeSeed<'de>>(self, seed: V) -> Result<(V::Value, Self), Problem> {
        let word: StrDeserializer<'de, Problem> = self.word.into_deserializer();
        match seed.deserialize(word) {
            Ok(variant) => Ok((variant, self)),
            Err(problem) => Err(match self.entry {
                Some(entry) => entry.place(problem.about("key"), entry.origin),
                None => problem.or_at(self.node.origin),
            }),
        }
    }
}

impl<'de> de::VariantAccess<'de> for Choice<'de> {
    type Error = Problem;

    fn unit_variant(self) -> Result<(), Problem> {
        match self.entry {
            None => Ok(()),
            Some(_) => Err(self.content(Problem::new("is a word by itself, without a value"))),
        }
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, Problem> {
        seed.deserialize(self.decoder()?).map_err(|p| self.content(p))
    }

    fn tuple_variant<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, Problem> {
        self.decoder()?.deserialize_any(visitor).map_err(|p| self.content(p))
    }

    fn struct_variant<V: Visitor<'de>>(self, fields: &'static [&'static str], visitor: V) -> Result<V::Value, Problem> {
        self.decoder()?.deserialize_struct("", fields, visitor).map_err(|p| self.content(p))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::yaml::{Origin, parse};
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Top {
        name: String,
        #[serde(default)]
        sizes: Vec<u32>,
        shape: Option<Shape>,
        scale: Option<f64>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "snake_case")]
    #[allow(dead_code)]
    enum Shape {
        Round,
        Box { edge: f64 },
    }

    fn refusal(text: &str) -> String {
        let tree = parse(text).unwrap();
        let problem = decode::<Top>(&tree).expect_err(text);
        let Some(Origin::File { line, column }) = problem.origin else { panic!("no place for {text}: {problem}") };
        format!("{line}:{column}: {}: {problem}", problem.path())
    }

    #[test]
    fn reads() {
        let tree =
            parse("name: x\nsizes: [1, 2, 3.0, 1e3, 007]\nshape: {box: {edge: 3}}\nscale: 100000000000000000000\n")
                .unwrap();
        let top: Top = decode(&tree).unwrap();
        assert_eq!((top.name.as_str(), top.sizes), ("x", vec![1, 2, 3, 1000, 7]));
        assert!(matches!(top.shape, Some(Shape::Box { edge: 3.0 })) && top.scale == Some(1e20));
        assert!(matches!(decode::<Top>(&parse("{name: x, shape: round}").unwrap()).unwrap().shape, Some(Shape::Round)));
    }

    #[test]
    fn refusals_have_line_path_expectation_and_remedy() {
        for (text, expected) in [
            ("nam: x\n", "1:1: nam: unknown key, did you mean `name`? (known: name, sizes, shape, scale)"),
            ("sizes: []\n", "1:1: : the key `name` is missing"),
            ("name: 3\n", "1:7: name: expected text, found the number 3; put it in quotes"),
            ("name: x\nsizes: [1, b]\n", "2:12: sizes[1]: expected a whole number, 0 or above, found the text \"b\""),
            ("name: x\nsizes: [-1]\n", "2:9: sizes[0]: expected a whole number, 0 or above, found the number -1"),
            ("name: x\nsizes: 3\n", "2:8: sizes: expected a list, found the number 3"),
            (
                "name: x\nscale: .nan\n",
                "2:8: scale: expected a finite number, found an infinite one or not a number (NaN)",
            ),
            ("name: x\nscale: true\n", "2:8: scale: expected a number, found `true`"),
            ("name: x\nscale:\n", "2:6: scale: has no value; give it one, or take the key out"),
            ("name: x\nshape: rond\n", "2:8: shape: unknown value `rond`, did you mean `round`? (known: round, box)"),
            ("name: x\nshape: {bix: 1}\n", "2:9: shape.bix: unknown key, did you mean `box`? (known: round, box)"),
            ("name: x\nshape: box\n", "2:8: shape: `box` needs a value: `box: ...`"),
            ("name: x\nshape: {round: 1}\n", "2:16: shape.round: is a word by itself, without a value"),
            ("name: x\nshape: {box: {edge: a}}\n", "2:21: shape.box.edge: expected a number, found the text \"a\""),
            (
                "name: x\nshape: {round: 1, box: 2}\n",
                "2:8: shape: expected one key out of round, box, found round, box",
            ),
            ("name: x\nshape: {box: 2}\n", "2:14: shape.box: expected a mapping (of edge), found the number 2"),
        ] {
            assert_eq!(refusal(text), expected);
        }
    }
}
