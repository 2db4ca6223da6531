//! The layout of payloads in memory, for programs in other languages: names, types and offsets of all fields. The same
//! description gives the values of a payload, field by field, and encodes it where there is no shared memory.

use super::{
    cdr::{Decoder, Encoder},
    payload::{Payload, Stamp, type_name},
};

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

/// `sample` as a message of its own.
pub fn encode_sample<P: Layout>(sample: &P, bytes: &mut Vec<u8>) {
    sample.encode(&mut Encoder::new(bytes));
}

/// `header` and `slice` as a message of their own.
pub fn encode_slice<H: Layout, T: Layout>(header: &H, slice: &[T], bytes: &mut Vec<u8>) {
    let mut to = Encoder::new(bytes);
    header.encode(&mut to);
    (slice.len() as u32).encode(&mut to);
    T::encode_all(slice, &mut to);
}

/// The sample in a message; none if the message holds another.
#[must_use]
pub fn decode_sample<P: Layout>(message: &[u8]) -> Option<P> {
    P::decode(&mut Decoder::new(message)?)
}

/// The header and slice in a message; none if the message holds others.
#[must_use]
pub fn decode_slice<H: Layout, T: Layout + Default>(message: &[u8]) -> Option<(H, Vec<T>)> {
    let mut from = Decoder::new(message)?;
    let header = H::decode(&mut from)?;
    let count = u32::decode(&mut from)? as usize;
    // The message may state any length, but each element takes at least a byte.
    let count = (count <= from.left()).then_some(count)?;
    let mut slice = vec![T::default(); count];
    T::decode_all(&mut slice, &mut from)?;
    Some((header, slice))
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
    pub fn of<P: Payload>(fields: Vec<Field>) -> Kind {
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

numbers!(u16: Unsigned u32: Unsigned u64: Unsigned i32: Signed f32: Single f64: Double);

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
layouts! {
    Stamp { tick stamp_ns generation sequence }
}
