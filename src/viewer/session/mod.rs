//! One page: what it asks for, and the worker that renders it.
//!
//! The page's messages go into a box (`page`); the worker takes the newest view out of it. One picture is under way at
//! a time: the next is begun when the page has shown it. So a slow link gets few pictures instead of old ones. `sides`
//! holds what was made of the view, `filming` a movie under way, `studio` the device that renders, and `words` tells
//! the page about a scene and a picture.

mod filming;
mod page;
mod sides;
mod studio;
mod words;
mod worker;

pub(super) use self::page::Page;
pub(super) use self::worker::Worker;
