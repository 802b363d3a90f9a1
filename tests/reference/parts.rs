//! Renders of the reference in several runs, and with several threads.

#![allow(clippy::unwrap_used, reason = "tests may stop")]

use splatblur::film::{Aov, Picture};
use splatblur::options::Look;
use splatblur::reference::{Reference, ReferenceOptions, Sums, render};
use splatblur::scene::Scene;

/// All values of a picture.
pub(crate) fn bits(picture: &Picture) -> Vec<u32> {
    let layers = picture.layers.iter().flat_map(|layer| layer.planes.iter().flatten());
    picture.rgba.iter().flatten().chain(layers).map(|v| v.to_bits()).collect()
}

/// One run, three runs over the disk, one thread, two and three: the same bytes. Gives the last of three runs and the
/// whole one.
pub(crate) fn assert_parts_and_threads_change_nothing(scene: &Scene) -> [Reference; 2] {
    let run = |samples: u64, threads: usize, sums: Option<Sums>| {
        let options = ReferenceOptions {
            samples,
            look: Look { aovs: Aov::ALL.to_vec(), ..Look::default() },
            ..ReferenceOptions::default()
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(scene, 0, &options, sums, &|_| ()).unwrap())
    };
    let whole = run(80, 1, None);
    assert!(bits(&whole.picture) == bits(&run(80, 3, None).picture), "threads");
    let mut sums: Option<Sums> = None;
    for samples in [16, 48, 80] {
        let part = run(samples, 3, sums);
        sums = Some(Sums::from_bytes(&part.sums.to_bytes("s")).unwrap().0);
    }
    let last = run(80, 2, sums);
    assert!(bits(&whole.picture) == bits(&last.picture), "parts");
    [last, whole]
}
