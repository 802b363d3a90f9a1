//! Run-time dispatch to wider vectors. This is the splatter's only `unsafe` code.

/// Defines `fn name(args)`, with its visibility, that returns `body(args)`. It is compiled once for the baseline and
/// once for AVX2.
///
/// `body` must be `#[inline(always)]`, so that it is compiled again inside the AVX2 version. Neither version contracts
/// multiplications and additions, so both give the same bits.
macro_rules! dispatch {
    ($(#[$doc:meta])* $vis:vis fn $name:ident($($arg:ident: $ty:ty),* $(,)?) $(-> $out:ty)? = $body:path) => {
        $(#[$doc])*
        $vis fn $name($($arg: $ty),*) $(-> $out)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn avx2($($arg: $ty),*) $(-> $out)? {
                    $body($($arg),*)
                }
                if std::arch::is_x86_feature_detected!("avx2") {
                    #[allow(unsafe_code, reason = "AVX2 was detected on the line before")]
                    // SAFETY: the CPU has the only feature that the function enables.
                    return unsafe { avx2($($arg),*) };
                }
            }
            $body($($arg),*)
        }
    };
}

pub(crate) use dispatch;
