//! Run-time dispatch to wider vectors. This is the splatter's only `unsafe` code.

/// Defines `fn name(args)`, with its visibility, that returns `body(args)`. It may have a type parameter. It is
/// compiled once for the baseline and once for AVX2.
///
/// `body` must be `#[inline(always)]`, so that it is compiled again inside the AVX2 version. Neither version contracts
/// multiplications and additions, so both give the same bits.
macro_rules! dispatch {
    ($(#[$doc:meta])* $vis:vis fn $name:ident $(<$of:ident: $bound:path>)? ($($arg:ident: $ty:ty),* $(,)?)
        $(-> $out:ty)? = $body:path) => {
        $(#[$doc])*
        $vis fn $name $(<$of: $bound>)? ($($arg: $ty),*) $(-> $out)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn avx2 $(<$of: $bound>)? ($($arg: $ty),*) $(-> $out)? {
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

#[cfg(test)]
mod tests {
    dispatch! {
        /// Writes x y + z of each lane to `out`, and returns their sum.
        fn sum_of_products(x: &[f32], y: &[f32; 19], z: f32, out: &mut Vec<f32>) -> f32 = body
    }

    #[inline(always)]
    fn body(x: &[f32], y: &[f32; 19], z: f32, out: &mut Vec<f32>) -> f32 {
        out.clear();
        out.extend(x.iter().zip(y).map(|(x, y)| x * y + z));
        out.iter().sum()
    }

    /// References go through, and the AVX2 version rounds each product before it adds: a fused multiply-add would not.
    #[test]
    fn both_versions_give_the_same_bits() {
        let x: Vec<f32> = (0..19).map(|i| 1.0 + i as f32 * 0.1).collect();
        let y = std::array::from_fn(|i| 1.0 / (i as f32 + 0.3));
        let (mut got, mut want) = (Vec::new(), Vec::new());
        let sums = [sum_of_products(&x, &y, -0.7, &mut got), body(&x, &y, -0.7, &mut want)];
        assert_eq!(sums[0].to_bits(), sums[1].to_bits());
        assert_eq!(got, want);
        assert!(x.iter().zip(&y).zip(&want).any(|((x, y), w)| x.mul_add(*y, -0.7) != *w));
    }
}
