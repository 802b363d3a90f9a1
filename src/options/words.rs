//! Options that are one of a few words.

/// Gives an enum of plain variants its text: one word for each variant, read by `FromStr` and written by `Display`.
macro_rules! words {
    ($type:ident, $what:literal, [$($variant:ident = $word:literal),+ $(,)?]) => {
        impl $type {
            /// The words of all variants, in order.
            pub const WORDS: &'static [&'static str] = &[$($word),+];

            /// The word of this variant.
            pub const fn word(self) -> &'static str {
                match self {
                    $(Self::$variant => $word),+
                }
            }
        }

        /// The variant's word.
        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.word())
            }
        }

        /// The variant of a word.
        impl std::str::FromStr for $type {
            type Err = $crate::options::OptionError;

            fn from_str(text: &str) -> Result<Self, Self::Err> {
                match text {
                    $($word => Ok(Self::$variant),)+
                    _ => Err($crate::options::OptionError::Word {
                        what: $what,
                        found: text.to_owned(),
                        known: Self::WORDS.join(", "),
                    }),
                }
            }
        }
    };
}

pub(crate) use words;
