//! Declarations of mission tables, their words, and enums in shared memory.

/// Declares mission tables. Unknown keys are errors, and so are missing ones without a default.
macro_rules! rows {
    ($($(#[$about:meta])* $name:ident { $($(#[$doc:meta])* $key:ident: $type:ty,)* })*) => {$(
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        $(#[$about])*
        pub struct $name {
            $($(#[$doc])* pub $key: $type,)*
        }
    )*};
}

/// Declares a mission table as keys with optional defaults, else the type's.
macro_rules! keys {
    (@) => { Default::default() };
    (@ $default:expr) => { $default };
    ($(#[$about:meta])* $name:ident { $($(#[$doc:meta])* $key:ident: $type:ty $(= $default:expr)?,)* }) => {
        rows! {
            #[serde(default)]
            $(#[$about])*
            $name { $($(#[$doc])* $key: $type,)* }
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($key: keys!(@ $($default)?),)* }
            }
        }
    };
}

/// Declares an enum that is one byte in shared memory, whose unknown values are read as a safe one.
/// Words after the bytes are those of a getter.
#[macro_export]
macro_rules! wire_enum {
    ($(#[$meta:meta])* $name:ident, unknown = $unknown:ident, text = $text:ident { $($(#[$doc:meta])* $variant:ident = $byte:literal $words:literal),* $(,)? }) => {
        $crate::wire_enum! { $(#[$meta])* $name, unknown = $unknown { $($(#[$doc])* $variant = $byte),* } }
        impl $name {
            pub const fn $text(self) -> &'static str {
                match self { $(Self::$variant => $words),* }
            }
        }
    };
    ($(#[$meta:meta])* $name:ident, unknown = $unknown:ident { $($(#[$doc:meta])* $variant:ident = $byte:literal),* $(,)? }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        pub enum $name { $($(#[$doc])* $variant = $byte),* }
        impl $name {
            pub const VALUES: &[(&str, u8)] = &[$((stringify!($variant), $byte)),*];

            /// Decodes a byte; an unknown one gives the safe value.
            pub const fn from_byte(byte: u8) -> Self {
                match byte {
                    $($byte => Self::$variant,)*
                    _ => Self::$unknown,
                }
            }
        }
        impl From<u8> for $name {
            fn from(byte: u8) -> Self {
                Self::from_byte(byte)
            }
        }
        impl From<$name> for u8 {
            fn from(value: $name) -> u8 {
                value as u8
            }
        }
    };
}

/// Declares choices that a mission writes as words in kebab case.
macro_rules! words {
    ($($(#[$about:meta])* $name:ident { $($choices:tt)* })*) => {$(
        #[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
        #[serde(rename_all = "kebab-case")]
        $(#[$about])*
        pub enum $name {
            $($choices)*
        }
    )*};
}
