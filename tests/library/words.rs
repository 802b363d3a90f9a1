//! Words to work under way and from it.

use std::sync::{Arc, Mutex};

use splatblur::reference::{self, ReferenceError, ReferenceOptions};
use splatblur::{BackendError, BlurMode, Device, Done, Progress, RenderOptions, Renderer, Scene, Stop};

fn scene() -> Scene {
    Scene::open("scenes/blinker_fence.xml").size(48, 32).load().unwrap()
}

/// A progress and what it was told.
fn listener() -> (Progress, Arc<Mutex<Vec<Done>>>) {
    let told = Arc::new(Mutex::new(Vec::new()));
    let into = Arc::clone(&told);
    (Progress::new(move |done| into.lock().unwrap().push(done)), told)
}

fn assert_ends_at_one(told: &Mutex<Vec<Done>>, rounds: u64, at_least: usize) {
    let told = told.lock().unwrap();
    assert!(told.len() >= at_least && told.iter().all(|done| (0.0..=1.0).contains(&done.share)), "{told:?}");
    let most = told.iter().fold(Done::default(), |most, done| Done {
        round: most.round.max(done.round),
        share: if done.round > most.round { done.share } else { most.share.max(done.share) },
    });
    assert_eq!(most, Done { round: rounds, share: 1.0 });
}

#[test]
fn a_renderer_tells_how_far_it_is() {
    let (progress, told) = listener();
    let mut renderer = Renderer::open(Device::Cpu).unwrap();
    renderer.tell(progress);
    let options = RenderOptions { quality: BlurMode::supersample(8).into(), ..RenderOptions::default() };
    for _ in 0..2 {
        told.lock().unwrap().clear();
        renderer.render(&scene(), 0, &options).unwrap();
        assert_ends_at_one(&told, 1, 8);
    }
}

#[test]
fn a_reference_tells_how_far_it_is() {
    let (progress, told) = listener();
    let options = ReferenceOptions { samples: 16, ..ReferenceOptions::default() };
    let watched = reference::picture_until(&scene(), 0, &options, &progress, &Stop::default()).unwrap();
    assert_ends_at_one(&told, 1, 8);
    let building: Vec<f64> =
        told.lock().unwrap().iter().filter(|done| done.round == 0).map(|done| done.share).collect();
    assert_eq!(building.last(), Some(&1.0), "{building:?}");
    assert_eq!(watched, reference::picture(&scene(), 0, &options).unwrap());
    // It needs all its rounds, because no picture has such an error.
    told.lock().unwrap().clear();
    let options = ReferenceOptions { samples: 512, error: Some(1e-9), ..options };
    reference::picture_until(&scene(), 0, &options, &progress, &Stop::default()).unwrap();
    assert_ends_at_one(&told, 2, 16);
}

#[test]
fn work_ends_when_it_is_told_to() {
    let stop = Arc::new(Stop::default());
    let mut renderer = Renderer::open(Device::Cpu).unwrap();
    renderer.heed(Arc::clone(&stop));
    stop.set();
    let ended = renderer.render(&scene(), 0, &RenderOptions::default());
    assert!(matches!(ended, Err(BackendError::Stopped)));
    let options = ReferenceOptions { samples: 16, ..ReferenceOptions::default() };
    let ended = reference::picture_until(&scene(), 0, &options, &listener().0, &stop);
    assert!(matches!(ended, Err(ReferenceError::Stopped)));
    stop.clear();
    assert!(renderer.render(&scene(), 0, &RenderOptions::default()).is_ok());
}

/// A reference ends before its first sample, too.
#[test]
fn a_reference_ends_while_it_builds_what_it_traces() {
    let (stop, told) = (Arc::new(Stop::default()), Arc::new(Mutex::new(Vec::new())));
    let (stops, into) = (Arc::clone(&stop), Arc::clone(&told));
    let progress = Progress::new(move |done| {
        into.lock().unwrap().push(done);
        stops.set();
    });
    let options = ReferenceOptions { samples: 16, ..ReferenceOptions::default() };
    let ended = reference::picture_until(&scene(), 0, &options, &progress, &stop);
    assert!(matches!(ended, Err(ReferenceError::Stopped)));
    let told = told.lock().unwrap();
    assert!(!told.is_empty() && told.iter().all(|done| done.round == 0), "{told:?}");
}

/// A reference ends within its samples of a pixel, too: so many would take hours.
#[test]
fn a_reference_of_many_samples_ends_when_it_is_told_to() {
    let stop = Stop::default();
    let options = ReferenceOptions { samples: 1 << 30, ..ReferenceOptions::default() };
    let ended = std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(std::time::Duration::from_millis(50));
            stop.set();
        });
        reference::picture_until(&scene(), 0, &options, &listener().0, &stop)
    });
    assert!(matches!(ended, Err(ReferenceError::Stopped)));
}
