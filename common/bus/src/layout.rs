//! The layout of payloads in memory, for programs in other languages: names, types and offsets of all fields. The same
//! description gives the values of a payload, field by field, and encodes it where there is no shared memory.
//!
//! Why `unsafe` is allowed here: the name of a payload can be read only through an `unsafe` call, which does nothing else.
#![allow(unsafe_code)]

use iceoryx2::prelude::ZeroCopySend;

use super::cdr::{Decoder, Encoder};

/// The name of a payload in all languages.
pub(super) fn type_name<P: ZeroCopySend>() -> &'static str {
    // SAFETY: the call only returns the name. Each payload promises its uniform layout where it derives the trait.
    unsafe { <P as ZeroCopySend>::type_name() }
}

/// A payload or a field whose layout is known.
pub trait Layout: Copy {
    /// The type.
    fn kind() -> Kind;

    /// The value.
    fn value(&self) -> Value;

    /// The value of an array.
    fn array(array: &[Self]) -> Value {
        Value::Array(array.iter().map(Self::value).collect())
    }

    /// Encode it, field by field.
    fn encode(&self, to: &mut Encoder<'_>);

    /// Decode the bytes that [`Layout::encode`] wrote; none where they are too short.
    fn decode(from: &mut Decoder<'_>) -> Option<Self>;

    /// Encode all of `items`, one after another.
    fn encode_all(items: &[Self], to: &mut Encoder<'_>) {
        for item in items {
            item.encode(to);
        }
    }

    /// Decode into all of `items`.
    fn decode_all(items: &mut [Self], from: &mut Decoder<'_>) -> Option<()> {
        for item in items {
            *item = Self::decode(from)?;
        }
        Some(())
    }
}

/// The value of a payload or a field.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// An unsigned integer.
    Unsigned(u64),
    /// A signed integer.
    Signed(i64),
    /// A number of 32 bits.
    Single(f32),
    /// A number of 64 bits.
    Double(f64),
    /// An array of bytes in a struct: UTF-8, filled up with zeros. Bytes that are not UTF-8 are replaced.
    Text(String),
    /// An array of values of one kind.
    Array(Vec<Self>),
    /// A struct: the names and values of its fields, in their order.
    Struct(Vec<(&'static str, Self)>),
}

/// The type of a payload or a field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A number; its name in Rust.
    Number(&'static str),
    /// An array: the kind and the number of its elements.
    Array(Box<Self>, usize),
    /// A struct.
    Struct(Structure),
}

/// A `repr(C)` struct.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Structure {
    /// The name in all languages, for example `firsthand.Pose`.
    pub name: &'static str,
    /// The size, bytes.
    pub size: usize,
    /// The fields, in their order.
    pub fields: Vec<Field>,
}

/// A field of a struct.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    pub name: &'static str,
    /// Bytes from the start of the struct.
    pub offset: usize,
    pub kind: Kind,
}

impl Structure {
    /// The kind of `P`, which has these fields.
    #[must_use]
    pub fn of<P: ZeroCopySend>(fields: Vec<Field>) -> Kind {
        Kind::Struct(Self { name: type_name::<P>(), size: size_of::<P>(), fields })
    }
}

/// The kind of the field that an accessor of the struct returns.
#[must_use]
pub fn kind_of<P, F: Layout>(_: fn(&P) -> &F) -> Kind {
    F::kind()
}

macro_rules! numbers {
    ($($number:ident: $value:ident)*) => {$(
        impl Layout for $number {
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
        }
    )*};
}

numbers!(u16: Unsigned u32: Unsigned u64: Unsigned i32: Signed i64: Signed f32: Single f64: Double);

impl Layout for u8 {
    fn kind() -> Kind {
        Kind::Number("u8")
    }

    fn value(&self) -> Value {
        Value::Unsigned((*self).into())
    }

    fn array(array: &[Self]) -> Value {
        let text = array.split(|&byte| byte == 0).next().unwrap_or_default();
        Value::Text(String::from_utf8_lossy(text).into_owned())
    }

    fn encode(&self, to: &mut Encoder<'_>) {
        to.bytes(&[*self]);
    }

    fn decode(from: &mut Decoder<'_>) -> Option<Self> {
        from.bytes(1)?.first().copied()
    }

    fn encode_all(items: &[Self], to: &mut Encoder<'_>) {
        to.bytes(items);
    }

    fn decode_all(items: &mut [Self], from: &mut Decoder<'_>) -> Option<()> {
        items.copy_from_slice(from.bytes(items.len())?);
        Some(())
    }
}

/// The element of a sample without a slice.
impl Layout for () {
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

impl<T: Layout + Default, const N: usize> Layout for [T; N] {
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
        let mut items = [T::default(); N];
        T::decode_all(&mut items, from)?;
        Some(items)
    }
}

/// Implements [`Layout`] for payloads from the names of their fields. If a field is missing in the list, the code does not compile.
#[macro_export]
macro_rules! layouts {
    ($($payload:ident { $($field:ident)* })*) => {$(
        impl $crate::Layout for $payload {
            fn kind() -> $crate::Kind {
                let _all = |&Self { $($field: _),* }: &Self| ();
                $crate::Structure::of::<Self>(vec![$($crate::Field {
                    name: stringify!($field),
                    offset: std::mem::offset_of!(Self, $field),
                    kind: $crate::kind_of(|payload: &Self| &payload.$field),
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
