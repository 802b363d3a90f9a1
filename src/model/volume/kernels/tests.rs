use std::sync::Arc;

use super::super::TransferStop;
use super::*;

fn ball(sizes: [usize; 3], steps: DMat3) -> Grid {
    let mut grid =
        Grid { sizes, origin: DVec3::new(0.5, -1.0, 2.0), steps, values: vec![], storage: "float", notes: vec![] };
    let count = sizes.iter().product();
    let index = |i: usize| [i % sizes[0], i / sizes[0] % sizes[1], i / sizes[0] / sizes[1]];
    let middle = grid.place(sizes.map(|size| size / 2));
    let radius = 0.45 * grid.extent().min_element();
    let value = |i: usize| (1.0 - (grid.place(index(i)) - middle).length() / radius).max(0.0) as f32;
    grid.values = (0..count).map(value).collect();
    grid
}

fn options() -> VolumeOptions {
    let stops = vec![
        TransferStop { value: 0.0, colour: Vec3::new(0.0, 0.5, 1.0), opacity: 0.0 },
        TransferStop { value: 1.0, colour: Vec3::new(2.0, 0.25, 0.0), opacity: 7.0 },
    ];
    VolumeOptions { transfer: Some(Arc::new(TransferFunction::new(stops).unwrap())), ..VolumeOptions::default() }
}

fn made(grid: &Grid, options: &VolumeOptions) -> Made {
    of_grid(grid, options, 1.0, u64::MAX, &|_, _| {}).unwrap()
}

fn covariance(g: &Gaussians, i: usize) -> DMat3 {
    let frame = DMat3::from_quat(g.rotation[i].as_dquat());
    let sigma = g.sigma[i].as_dvec3();
    frame * DMat3::from_diagonal(sigma * sigma) * frame.transpose()
}

fn near(a: DMat3, b: DMat3, what: &str) {
    // Standard deviations and quaternions in single precision: some 1e-7 each.
    let size = b.to_cols_array().into_iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    assert!(a.abs_diff_eq(b, 1e-6 * size), "{what}: {a} is not {b}");
}

#[test]
fn each_sample_with_extinction_is_a_kernel_in_its_place() {
    let turn = DMat3::from_rotation_y(0.4);
    // One axis is mirrored: a rotation alone cannot say that, and a kernel need not.
    let steps = turn * DMat3::from_diagonal(DVec3::new(0.1, -0.2, 0.3));
    let grid = ball([9, 8, 7], steps);
    let Made { gaussians: g, facts, .. } = made(&grid, &options());
    let shown: Vec<usize> = (0..grid.values.len()).filter(|i| grid.values[*i] > 0.0).collect();
    assert_eq!((g.len(), facts.samples, facts.sizes), (shown.len(), 504, Some([9, 8, 7])));
    assert!(g.len() > 30 && g.len() < 500 && g.linear && g.degree == 0 && g.normal.is_empty());
    let Optics::Extinction { layer } = g.optics else { panic!("{:?}", g.optics) };
    assert!((f64::from(layer) - LAYER * libm::cbrt(0.006)).abs() < 1e-6);
    for (at, i) in shown.into_iter().enumerate() {
        let value = f64::from(grid.values[i]);
        assert_eq!(g.position[at], grid.place([i % 9, i / 9 % 8, i / 72]).as_vec3());
        assert!((f64::from(g.opacity[at]) - 7.0 * value * 0.006).abs() < 1e-8);
        let colour = Vec3::new(2.0 * value as f32, 0.5 - 0.25 * value as f32, 1.0 - value as f32);
        assert!((g.colour(at) - colour).abs().max_element() < 5e-7, "{} {colour}", g.colour(at));
        near(covariance(&g, at), KERNEL * KERNEL * steps * steps.transpose(), "covariance");
    }
}

/// Equation 37 where the kernel is round: the normal's variance is divided by s^2, the others stay.
#[test]
fn flat_kernels_lose_their_extent_along_the_gradient() {
    let grid = ball([12, 12, 12], DMat3::from_diagonal(DVec3::splat(0.1)));
    let plain = made(&grid, &VolumeOptions { lit: true, ..options() });
    assert_eq!(plain.gaussians.normal.len(), plain.gaussians.len());
    for flatten in [2.0, 8.0, f64::INFINITY] {
        let flat = made(&grid, &VolumeOptions { flatten, lit: true, ..options() }).gaussians;
        assert_eq!(flat.opacity, plain.gaussians.opacity);
        let mut turned = 0;
        for i in 0..flat.len() {
            let n = flat.normal[i].as_dvec3();
            let round = DMat3::from_diagonal(DVec3::splat(0.06 * 0.06));
            if n == DVec3::ZERO {
                near(covariance(&flat, i), round, "no gradient");
                continue;
            }
            turned += 1;
            let outer = DMat3::from_cols(n * n.x, n * n.y, n * n.z);
            near(covariance(&flat, i), round - outer * (0.06 * 0.06 * (1.0 - 1.0 / (flatten * flatten))), "flat");
            assert!((n.length() - 1.0).abs() < 1e-6);
            // Out of the dense middle.
            let out = flat.position[i].as_dvec3() - grid.place([6, 6, 6]);
            assert!(n.dot(out) >= 0.0, "{n} at {out}");
        }
        assert!(turned > 100, "{turned}");
    }
}

/// In an uneven grid: what stays across the normal is the covariance there.
#[test]
fn flat_kernels_of_uneven_grids() {
    let grid = ball([10, 20, 5], DMat3::from_rotation_x(0.3) * DMat3::from_diagonal(DVec3::new(0.1, 0.05, 0.2)));
    let plain = made(&grid, &options()).gaussians;
    let flat = made(&grid, &VolumeOptions { flatten: 4.0, lit: true, ..options() }).gaussians;
    for i in 0..flat.len() {
        let n = flat.normal[i].as_dvec3();
        if n == DVec3::ZERO {
            continue;
        }
        let (before, after) = (covariance(&plain, i), covariance(&flat, i));
        let (s, t) = n.any_orthonormal_pair();
        // Covariances are about 0.01: the bound is rounding of single precision.
        for (a, b) in [(s, s), (s, t), (t, t)] {
            assert!((a.dot(before * b) - a.dot(after * b)).abs() < 1e-8);
        }
        assert!((n.dot(after * n) - n.dot(before * n) / 16.0).abs() < 1e-8);
        assert!(s.dot(after * n).abs() < 1e-8 && t.dot(after * n).abs() < 1e-8);
    }
}

#[test]
fn the_default_shows_the_greatest_value() {
    let grid = ball([8, 8, 8], DMat3::from_diagonal(DVec3::splat(0.5)));
    let Made { gaussians, notes, .. } = made(&grid, &VolumeOptions::default());
    // 10 over an extent of 4.
    let greatest = grid.range()[1];
    let most = gaussians.opacity.iter().copied().fold(0.0, f32::max);
    assert!((most - 2.5 * 0.125).abs() < 1e-6, "{most}");
    assert!(notes[0].contains("from 0 at 0 to 2.5 at") && greatest > 0.9, "{notes:?}");
    let even = Grid { values: vec![3.0; 512], ..grid };
    let Made { gaussians, notes, .. } = made(&even, &VolumeOptions::default());
    assert!(gaussians.is_empty() && notes[0].contains("all values are equal (3)"), "{notes:?}");
}

#[test]
fn samples_count_like_cells_of_their_radii() {
    let samples = Samples {
        position: vec![DVec3::X, DVec3::Y, DVec3::Z],
        radius: vec![0.5, 0.25, 1.0],
        density: vec![2.0, 4.0, -1.0],
        colour: vec![Vec3::new(0.1, 0.2, 0.3); 3],
        ..Samples::default()
    };
    let make = |samples: &Samples, options: &VolumeOptions| of_samples(samples, options, 2.0, 9, &|_, _| {});
    let g = make(&samples, &VolumeOptions::default()).unwrap().gaussians;
    // A negative density takes nothing away.
    assert_eq!((g.opacity.as_slice(), &g.position[..]), ([0.25, 0.0625].as_slice(), &[Vec3::X, Vec3::Y][..]));
    assert_eq!(g.sigma, [Vec3::splat(0.6), Vec3::splat(0.3)]);
    assert!((g.colour(1) - Vec3::new(0.1, 0.2, 0.3)).abs().max_element() < 1e-7);
    assert_eq!(g.optics, Optics::Extinction { layer: (0.5 * LAYER) as f32 });
    let g = make(&samples, &options()).unwrap().gaussians;
    assert_eq!(g.opacity, [0.875, 7.0 / 64.0]);
    let own = Samples { volume: vec![1.0, 2.0, 3.0], ..samples };
    assert_eq!(make(&own, &VolumeOptions::default()).unwrap().gaussians.opacity, [2.0, 8.0]);
    assert!(of_samples(&own, &VolumeOptions::default(), 1.0, 1, &|_, _| {}).is_err());
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let grid = ball([40, 30, 50], DMat3::from_diagonal(DVec3::splat(0.1)));
    let options = VolumeOptions { flatten: 3.0, lit: true, ..options() };
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| made(&grid, &options).gaussians)
    };
    assert_eq!(with(1), with(4));
}
