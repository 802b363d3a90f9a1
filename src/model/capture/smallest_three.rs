//! Unit quaternions stored as three of their four components.

/// The quaternion whose component `left_out` (0 to 3) is not stored: the positive one that makes the length 1. `others`
/// are the rest in order. Rounding may make them longer than 1 alone; then the missing one is 0.
pub(super) fn restore(left_out: usize, others: [f64; 3]) -> [f64; 4] {
    let missing = (1.0 - others.iter().map(|c| c * c).sum::<f64>()).max(0.0).sqrt();
    let [a, b, c] = others;
    match left_out {
        0 => [missing, a, b, c],
        1 => [a, missing, b, c],
        2 => [a, b, missing, c],
        _ => [a, b, c, missing],
    }
}
