//! The interactive viewer: a scene in a page of the browser, served on the loopback address unless told otherwise.
//!
//! A page holds all of its own state: it sends its whole view whenever something changes (`view`), and gets pictures
//! back. So pages do not disturb each other, and a page goes on after the program was restarted. Each page has a worker
//! (`session`). It asks `stage` what to render next: while something moves a quick picture, whose size and samples
//! `pace` chooses, then the mode that was asked for. `display` turns pictures and layers into PNG, `save` into files.
//! `shared` holds what all pages share, `watch` loads the scene, again whenever one of its files changes. `server`
//! alone knows HTTP and WebSockets.

mod camera;
mod display;
mod error;
mod lights;
mod message;
mod pace;
mod path;
mod save;
mod server;
mod session;
mod shared;
mod stage;
mod view;
mod watch;

pub use self::error::ViewerError;
pub use self::server::Viewer;
pub use self::shared::Setup;
