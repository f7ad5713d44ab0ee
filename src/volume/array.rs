//! A named array of tuples, one tuple a point, and the ten number types it may be made of.
//!
//! [`Values`] keeps numbers as the type they were read or computed in: a comparison of two `u8` images is exact, and
//! a written file has the type that was asked for. The macro below is the only place that lists the ten types.

use serde::Serialize;

macro_rules! numbers {
    ($($kind:ident $number:ty, $vtk:literal);+ $(;)?) => {
        /// The numbers of an array, tuple after tuple.
        #[derive(Clone, Debug, PartialEq)]
        #[allow(missing_docs)]
        pub enum Values { $($kind(Vec<$number>)),+ }

        /// A type of number, without numbers.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
        #[serde(rename_all = "lowercase")]
        #[allow(missing_docs)]
        pub enum Kind { $($kind),+ }

        impl Kind {
            /// All of them.
            pub const ALL: [Kind; 10] = [$(Kind::$kind),+];

            /// Bytes a number.
            pub fn size(self) -> usize {
                match self { $(Kind::$kind => size_of::<$number>()),+ }
            }

            /// What VTK's XML files call it, `Float32` say.
            pub fn vtk_name(self) -> &'static str {
                match self { $(Kind::$kind => $vtk),+ }
            }

            /// The numbers in `bytes`, which hold nothing but numbers of this type; a last incomplete one is left out.
            pub fn decode(self, bytes: &[u8], little_endian: bool) -> Values {
                match self {
                    $(Kind::$kind => Values::$kind(
                        bytes
                            .chunks_exact(size_of::<$number>())
                            .map(|b| {
                                let b = b.try_into().unwrap_or_default();
                                if little_endian { <$number>::from_le_bytes(b) } else { <$number>::from_be_bytes(b) }
                            })
                            .collect(),
                    )),+
                }
            }

            /// So many zeros of this type.
            pub fn zeros(self, count: usize) -> Values {
                match self { $(Kind::$kind => Values::$kind(vec![Default::default(); count])),+ }
            }

            /// The numbers in words of text; the first word that is no such number otherwise.
            pub fn parse<'a>(self, words: impl Iterator<Item = &'a str>) -> Result<Values, &'a str> {
                match self {
                    $(Kind::$kind => Ok(Values::$kind(words.map(|w| w.parse().map_err(|_| w)).collect::<Result<_, _>>()?))),+
                }
            }
        }

        impl Values {
            /// The type of the numbers.
            pub fn kind(&self) -> Kind {
                match self { $(Values::$kind(_) => Kind::$kind),+ }
            }

            /// How many numbers there are.
            pub fn len(&self) -> usize {
                match self { $(Values::$kind(v) => v.len()),+ }
            }

            /// The `i`-th number in double precision; exact but for 64-bit integers above 2^53.
            ///
            /// # Panics
            /// If there is none, as a slice does.
            pub fn get(&self, i: usize) -> f64 {
                match self { $(Values::$kind(v) => v[i] as f64),+ }
            }

            /// All numbers in double precision.
            pub fn to_f64(&self) -> Vec<f64> {
                match self { $(Values::$kind(v) => v.iter().map(|&x| x as f64).collect()),+ }
            }

            /// Puts `count` numbers, those of `from` from number `start` on, in place of those from number `at` on. Whether that
            /// can be: not if the types differ, or if one of the two has fewer numbers.
            #[must_use]
            pub fn place(&mut self, at: usize, from: &Values, start: usize, count: usize) -> bool {
                match (self, from) {
                    $((Values::$kind(to), Values::$kind(from)) => {
                        let places = at.checked_add(count).and_then(|end| to.get_mut(at..end));
                        let numbers = start.checked_add(count).and_then(|end| from.get(start..end));
                        match (places, numbers) {
                            (Some(places), Some(numbers)) => places.copy_from_slice(numbers),
                            _ => return false,
                        }
                        true
                    })+
                    _ => false,
                }
            }

            /// Puts all numbers of another list behind these. Numbers of another type are left where they are.
            pub fn append(&mut self, more: &Values) {
                match (self, more) {
                    $((Values::$kind(all), Values::$kind(more)) => all.extend_from_slice(more),)+
                    _ => {}
                }
            }

            /// Appends the numbers from `range` as little-endian bytes.
            ///
            /// # Panics
            /// If the range reaches beyond the numbers, as a slice does.
            pub fn extend_le_bytes(&self, range: std::ops::Range<usize>, bytes: &mut Vec<u8>) {
                match self {
                    $(Values::$kind(v) => {
                        // Room first: then this is a copy, not a push a number.
                        let (start, numbers) = (bytes.len(), &v[range]);
                        bytes.resize(start + size_of_val(numbers), 0);
                        for (place, x) in bytes[start..].chunks_exact_mut(size_of::<$number>()).zip(numbers) {
                            place.copy_from_slice(&x.to_le_bytes());
                        }
                    }),+
                }
            }

            /// Writes number `i` as a person would read it: integers whole, floats as short as they read back.
            pub fn format(&self, i: usize) -> String {
                match self { $(Values::$kind(v) => v.get(i).map(|x| format!("{x:?}")).unwrap_or_default()),+ }
            }
        }

        $(impl From<Vec<$number>> for Values {
            fn from(numbers: Vec<$number>) -> Self {
                Values::$kind(numbers)
            }
        })+
    };
}

numbers! {
    I8 i8, "Int8";
    U8 u8, "UInt8";
    I16 i16, "Int16";
    U16 u16, "UInt16";
    I32 i32, "Int32";
    U32 u32, "UInt32";
    I64 i64, "Int64";
    U64 u64, "UInt64";
    F32 f32, "Float32";
    F64 f64, "Float64";
}

impl Values {
    /// Whether there are no numbers.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number `i` as an integer, if the numbers are integers; exact for all of them.
    pub fn integer(&self, i: usize) -> Option<i128> {
        Some(match self {
            Values::I8(v) => v[i].into(),
            Values::U8(v) => v[i].into(),
            Values::I16(v) => v[i].into(),
            Values::U16(v) => v[i].into(),
            Values::I32(v) => v[i].into(),
            Values::U32(v) => v[i].into(),
            Values::I64(v) => v[i].into(),
            Values::U64(v) => v[i].into(),
            Values::F32(_) | Values::F64(_) => return None,
        })
    }
}

impl Kind {
    /// The type that VTK's XML files call `name`.
    pub fn from_vtk_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|k| k.vtk_name() == name)
    }
}

/// A named array of tuples.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// What the array holds, `ambient_occlusion` say.
    pub name: String,
    /// Numbers a tuple; at least 1.
    pub components: usize,
    /// `components` numbers a point, point after point.
    pub values: Values,
}

impl Array {
    /// An array of tuples of `components` numbers.
    pub fn new(name: impl Into<String>, components: usize, values: impl Into<Values>) -> Self {
        Self { name: name.into(), components, values: values.into() }
    }

    /// The same without its numbers.
    pub fn clone_head(&self) -> Self {
        Self { name: self.name.clone(), components: self.components, values: self.values.kind().zeros(0) }
    }

    /// The number of tuples.
    pub fn tuples(&self) -> usize {
        self.values.len() / self.components.max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_round_trip_in_both_orders() {
        for kind in Kind::ALL {
            let values = kind.parse(["1", "2", "100"].into_iter()).unwrap();
            assert_eq!(values.kind(), kind);
            assert_eq!(Kind::from_vtk_name(kind.vtk_name()), Some(kind));
            let mut bytes = Vec::new();
            values.extend_le_bytes(0..3, &mut bytes);
            assert_eq!(bytes.len(), 3 * kind.size());
            assert_eq!(kind.decode(&bytes, true), values);
            let swapped: Vec<u8> = bytes.chunks(kind.size()).flat_map(|b| b.iter().rev().copied()).collect();
            assert_eq!(kind.decode(&swapped, false), values);
            assert_eq!(values.to_f64(), [1.0, 2.0, 100.0]);
        }
    }

    #[test]
    fn words_out_of_range_are_named() {
        assert_eq!(Kind::U8.parse(["7", "256"].into_iter()), Err("256"));
        assert_eq!(Kind::I32.parse(["1.5"].into_iter()), Err("1.5"));
    }
}
