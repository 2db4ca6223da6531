//! How payloads lie in memory, for programs in other languages: names, types and offsets of all fields; and what a payload
//! holds, field by field, for whoever shows it.

use super::payload::{Payload, type_name};

/// A payload, or a part of one, whose layout is known.
pub trait Layout: Sized {
    /// What it is made of.
    fn kind() -> Kind;

    /// What this one holds.
    fn value(&self) -> Value;

    /// What an array of them holds.
    fn array(array: &[Self]) -> Value {
        Value::Array(array.iter().map(Self::value).collect())
    }
}

/// What a payload, or a part of one, holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// An integer without sign.
    Unsigned(u64),
    /// An integer.
    Signed(i64),
    /// A number of 32 bits.
    Single(f32),
    /// A number of 64 bits.
    Double(f64),
    /// An array of bytes in a struct: UTF-8, filled up with zeros. What is not UTF-8 is replaced.
    Text(String),
    /// Of one kind.
    Array(Vec<Self>),
    /// Its fields by their names, in their order.
    Struct(Vec<(&'static str, Self)>),
}

/// What a field is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A number; its name in Rust.
    Number(&'static str),
    /// So many of one kind.
    Array(Box<Self>, usize),
    /// A struct.
    Struct(Structure),
}

/// A `repr(C)` struct.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Structure {
    /// Its name for every language: `firsthand.Pose`.
    pub name: &'static str,
    /// Bytes.
    pub size: usize,
    /// In their order.
    pub fields: Vec<Field>,
}

/// A field of a struct.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// Bytes from the start of the struct.
    pub offset: usize,
    /// What it is.
    pub kind: Kind,
}

impl Structure {
    /// Of `P`, which has these fields.
    pub(crate) fn of<P: Payload>(fields: Vec<Field>) -> Kind {
        Kind::Struct(Self {
            name: type_name::<P>(),
            size: size_of::<P>(),
            fields,
        })
    }
}

/// What the field is that a struct's accessor gives.
pub(crate) fn kind_of<P, F: Layout>(_: fn(&P) -> &F) -> Kind {
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
}

impl<T: Layout, const N: usize> Layout for [T; N] {
    fn kind() -> Kind {
        Kind::Array(Box::new(T::kind()), N)
    }

    fn value(&self) -> Value {
        T::array(self)
    }
}

/// The fields of structs, all of them: one that is missing here does not compile.
macro_rules! layouts {
    ($($payload:ident { $($field:ident)* })*) => {$(
        impl $crate::bus::Layout for $payload {
            fn kind() -> $crate::bus::Kind {
                let _all = |&Self { $($field: _),* }: &Self| ();
                $crate::bus::Structure::of::<Self>(vec![$($crate::bus::Field {
                    name: stringify!($field),
                    offset: std::mem::offset_of!(Self, $field),
                    kind: $crate::bus::kind_of(|payload: &Self| &payload.$field),
                }),*])
            }

            fn value(&self) -> $crate::bus::Value {
                $crate::bus::Value::Struct(vec![$(
                    (stringify!($field), $crate::bus::Layout::value(&self.$field))
                ),*])
            }
        }
    )*};
}
pub(crate) use layouts;
