//! A rendering that says how far it is, until another thread stops it: `cargo run --release --example
//! stop_and_progress`.

use std::error::Error;
use std::sync::{Arc, mpsc};
use std::thread;

use splatblur::{BackendError, Device, Done, Picture, Progress, RenderOptions, Renderer, Scene, Stop};

/// Frame 4; `None` where it was stopped. `told` hears in another thread how far it is, and stops it by `true`.
pub(crate) fn render(
    width: u32,
    height: u32,
    told: impl Fn(Done) -> bool + Send + 'static,
) -> Result<Option<Picture>, Box<dyn Error>> {
    let scene = Scene::open("scenes/blinker_fence.xml").size(width, height).load()?;
    let mut renderer = Renderer::open(Device::Cpu)?;
    let stop = Arc::new(Stop::default());
    renderer.heed(Arc::clone(&stop));
    // Without a buffer: the frame waits until it is heard.
    let (sender, heard) = mpsc::sync_channel(0);
    renderer.tell(Progress::new(move |done| sender.send(done).unwrap_or_default()));
    let watcher = thread::spawn(move || {
        for done in heard {
            if told(done) {
                stop.set();
            }
        }
    });
    let rendered = renderer.render(&scene, 4, &RenderOptions::default());
    // With the renderer goes the sender, so the watcher ends.
    drop(renderer);
    watcher.join().map_err(|_| "the watcher failed")?;
    match rendered {
        Ok(rendered) => Ok(Some(rendered.picture)),
        Err(BackendError::Stopped) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

#[allow(clippy::print_stdout, dead_code, reason = "the example says what it does; a test calls the function above")]
fn main() -> Result<(), Box<dyn Error>> {
    for most in [0.5, f64::INFINITY] {
        let picture = render(320, 180, move |done| {
            println!("round {}: {:.0} %", done.round, 100.0 * done.share);
            done.share >= most
        })?;
        println!("{}", if picture.is_some() { "finished" } else { "stopped" });
    }
    Ok(())
}
