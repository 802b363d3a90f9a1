//! The energy of a picture at the Nyquist frequency: what a woven lattice adds.

/// Edge of a block, pixels.
const BLOCK: usize = 8;

/// Mean over blocks of 8 x 8 pixels of the squares of three bins of their discrete Fourier transform: (pi, 0), (0, pi)
/// and (pi, pi), each a mean of the block's values with alternating signs. Values are those of one channel, row by row.
pub(crate) fn energy(values: &[f64], width: usize) -> f64 {
    let sign = |odd: usize| if odd.is_multiple_of(2) { 1.0 } else { -1.0 };
    let (columns, rows) = (width / BLOCK, values.len() / width / BLOCK);
    let bin = |left: usize, top: usize, [u, v]: [usize; 2]| {
        let places = (0..BLOCK * BLOCK).map(|i| [i % BLOCK, i / BLOCK]);
        let sum: f64 = places.map(|[x, y]| sign(u * x + v * y) * values[(top + y) * width + left + x]).sum();
        (sum / (BLOCK * BLOCK) as f64).powi(2)
    };
    let blocks = (0..columns * rows).map(|i| [i % columns * BLOCK, i / columns * BLOCK]);
    let of_block =
        |[left, top]: [usize; 2]| [[1, 0], [0, 1], [1, 1]].map(|bins| bin(left, top, bins)).iter().sum::<f64>();
    blocks.map(of_block).sum::<f64>() / (columns * rows) as f64
}

#[test]
fn the_energy_of_a_comb_is_the_square_of_its_height() {
    let comb: Vec<f64> = (0..16 * 8).map(|i| if i % 2 == 0 { 0.6 } else { 0.4 }).collect();
    assert!((energy(&comb, 16) - 0.01).abs() < 1e-15);
    assert!(energy(&vec![0.5; 128], 16) < 1e-30);
}
