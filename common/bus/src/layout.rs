//! Memory layout of payloads for other languages: names, types and offsets of all fields. It also
//! yields a payload's values and encodes it outside shared memory.
//!
//! Why `unsafe` is allowed here: the name of a payload can be read only through an `unsafe` call,
//! which does nothing else.
#![allow(unsafe_code)]

use std::fmt;

use iceoryx2::prelude::ZeroCopySend;
use serde::{Serialize, Serializer};

use super::cdr::{Decoder, Encoder};

pub(super) fn type_name<P: ZeroCopySend>() -> &'static str {
    // SAFETY: the call only returns the name. Each payload promises its uniform layout where it
    // derives the trait.
    unsafe { <P as ZeroCopySend>::type_name() }
}

pub trait Layout: Copy {
    fn zero() -> Self;

    fn kind() -> Kind;

    fn value(&self) -> Value;

    fn array(array: &[Self]) -> Value {
        Value::Array(array.iter().map(Self::value).collect())
    }

    fn encode(&self, to: &mut Encoder<'_>);

    fn decode(from: &mut Decoder<'_>) -> Option<Self>;

    fn encode_all(items: &[Self], to: &mut Encoder<'_>) {
        for item in items {
            item.encode(to);
        }
    }

    fn decode_all(items: &mut [Self], from: &mut Decoder<'_>) -> Option<()> {
        for item in items {
            *item = Self::decode(from)?;
        }
        Some(())
    }
}

/// Value of a payload or field. A struct serializes as a map in the order of its fields.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    Unsigned(u64),
    Signed(i64),
    Single(f32),
    Double(f64),
    /// Byte array in a struct: UTF-8, padded with zeros. Invalid bytes are replaced.
    Text(String),
    Array(Vec<Self>),
    Struct(#[serde(serialize_with = "as_map")] Vec<(&'static str, Self)>),
}

fn as_map<S: Serializer>(fields: &[(&'static str, Value)], to: S) -> Result<S::Ok, S::Error> {
    to.collect_map(fields.iter().map(|(name, value)| (name, value)))
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Number, by its name in Rust.
    Number(&'static str),
    Array(Box<Self>, usize),
    Struct(Structure),
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Structure {
    /// For example `firsthand.Pose`.
    pub name: &'static str,
    pub size: usize,
    pub fields: Vec<Field>,
}

#[derive(Clone, PartialEq, Eq)]
pub struct Field {
    pub name: &'static str,
    pub offset: usize,
    pub kind: Kind,
    /// Field comment, lines joined; empty for none.
    pub doc: &'static str,
}

/// Omits the comment, so that it leaves the checksum of a layout unchanged.
impl fmt::Debug for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, offset, kind, .. } = self;
        f.debug_tuple("Field").field(name).field(offset).field(kind).finish()
    }
}

impl Structure {
    pub fn of<P: ZeroCopySend>(fields: Vec<Field>) -> Kind {
        debug_assert!(fields.is_sorted_by_key(|field| field.offset));
        Kind::Struct(Self { name: type_name::<P>(), size: size_of::<P>(), fields })
    }
}

pub fn kind_of<P, F: Layout>(_: fn(&P) -> &F) -> Kind {
    F::kind()
}

/// Returns the text in an array that is padded with zeros.
pub fn unpadded(array: &[u8]) -> &[u8] {
    array.split(|&byte| byte == 0).next().unwrap_or_default()
}

macro_rules! numbers {
    ($($number:ident: $value:ident $({ $($of_many:tt)* })?)*) => {$(
        impl Layout for $number {
            fn zero() -> Self {
                0 as Self
            }

            fn kind() -> Kind {
                Kind::Number(stringify!($number))
            }

            fn value(&self) -> Value {
                Value::$value((*self).into())
            }

            fn encode(&self, to: &mut Encoder<'_>) {
                to.number(self.to_le_bytes());
            }

            fn decode(from: &mut Decoder<'_>) -> Option<Self> {
                from.number().map(Self::from_le_bytes)
            }

            $($($of_many)*)?
        }
    )*};
}

numbers! {
    u8: Unsigned {
        fn array(array: &[Self]) -> Value {
            Value::Text(String::from_utf8_lossy(unpadded(array)).into_owned())
        }

        fn encode_all(items: &[Self], to: &mut Encoder<'_>) {
            to.bytes(items);
        }

        fn decode_all(items: &mut [Self], from: &mut Decoder<'_>) -> Option<()> {
            items.copy_from_slice(from.bytes(items.len())?);
            Some(())
        }
    }
    u16: Unsigned u32: Unsigned u64: Unsigned i32: Signed i64: Signed f32: Single f64: Double
}

/// Element of a sample without a slice.
impl Layout for () {
    fn zero() {}

    fn kind() -> Kind {
        Structure::of::<Self>(Vec::new())
    }

    fn value(&self) -> Value {
        Value::Struct(Vec::new())
    }

    fn encode(&self, _: &mut Encoder<'_>) {}

    fn decode(_: &mut Decoder<'_>) -> Option<Self> {
        Some(())
    }
}

impl<T: Layout, const N: usize> Layout for [T; N] {
    fn zero() -> Self {
        [T::zero(); N]
    }

    fn kind() -> Kind {
        Kind::Array(Box::new(T::kind()), N)
    }

    fn value(&self) -> Value {
        T::array(self)
    }

    fn encode(&self, to: &mut Encoder<'_>) {
        T::encode_all(self, to);
    }

    fn decode(from: &mut Decoder<'_>) -> Option<Self> {
        let mut items = Self::zero();
        T::decode_all(&mut items, from)?;
        Some(items)
    }
}

/// Implements [`Layout`] for payloads from their field names. A missing field is a compile error.
#[macro_export]
macro_rules! layouts {
    ($($payload:ident { $($field:ident $([$($doc:literal)*])?)* })*) => {$(
        impl $crate::Layout for $payload {
            fn zero() -> Self {
                Self { $($field: $crate::Layout::zero()),* }
            }

            fn kind() -> $crate::Kind {
                let _all = |&Self { $($field: _),* }: &Self| ();
                $crate::Structure::of::<Self>(vec![$($crate::Field {
                    name: stringify!($field),
                    offset: std::mem::offset_of!(Self, $field),
                    kind: $crate::kind_of(|payload: &Self| &payload.$field),
                    doc: concat!($($($doc),*)?),
                }),*])
            }

            fn value(&self) -> $crate::Value {
                $crate::Value::Struct(vec![$(
                    (stringify!($field), $crate::Layout::value(&self.$field))
                ),*])
            }

            fn encode(&self, to: &mut $crate::cdr::Encoder<'_>) {
                $($crate::Layout::encode(&self.$field, to);)*
            }

            fn decode(from: &mut $crate::cdr::Decoder<'_>) -> Option<Self> {
                Some(Self {
                    $($field: $crate::Layout::decode(from)?),*
                })
            }
        }
    )*};
}
