//! Materials of OBJ files (MTL), and where their textures are.
//!
//! Paths are those of the computer that wrote the file, often with backslashes, drives and `..`. A file is looked for
//! beside the OBJ under its whole name, then without its first folders, one after another. Nothing outside the OBJ's
//! folder is opened. A file that is not found is a note.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::Vec4;

use super::texture::{self, Budget, NoTexture};
use super::{AlphaMode, Mesh, MeshMaterial, Wrap};
use crate::gltf::{beside, read};
use crate::model::error::quote;
use crate::model::ply_body::number;

/// Most folders of a path.
const MOST_FOLDERS: usize = 64;

/// Most notes of a kind.
const MOST_NOTES: usize = 20;

/// Most material libraries of a file.
const MOST_LIBRARIES: usize = 256;

/// The materials that an OBJ may name.
pub(super) struct Library<'a> {
    path: &'a Path,
    /// As the libraries say, by name.
    said: HashMap<String, Said>,
    /// Index in the mesh of those that are used, by name.
    known: HashMap<String, u32>,
    /// Index in the mesh of textures that were looked for.
    textures: HashMap<(String, bool), Option<u32>>,
    read: Vec<String>,
    notes: Vec<String>,
    budget: Budget,
}

/// A material as the library says it.
#[derive(Clone, Debug, Default)]
struct Said {
    diffuse: Option<[f32; 3]>,
    /// `d`.
    opacity: Option<f32>,
    /// `Tr`.
    transparency: Option<f32>,
    texture: Option<String>,
    clamp: bool,
    has_cut_out: bool,
}

impl<'a> Library<'a> {
    pub(super) fn new(path: &'a Path, size: usize) -> Self {
        Self {
            path,
            said: HashMap::new(),
            known: HashMap::new(),
            textures: HashMap::new(),
            read: Vec::new(),
            notes: Vec::new(),
            budget: Budget::new(size),
        }
    }

    /// Reads `names`: one library whose name may have blanks, or several. The error says what is wrong with one.
    pub(super) fn add(&mut self, names: &str, mesh: &mut Mesh) -> Result<(), String> {
        if names.is_empty() {
            return Ok(());
        }
        let whole = self.find(names).is_some();
        let several: Vec<&str> = if whole { vec![names] } else { names.split_ascii_whitespace().collect() };
        let list = if several.iter().all(|name| self.find(name).is_none()) { vec![names] } else { several };
        for name in list {
            if self.read.iter().any(|read| read == name) {
                continue;
            }
            if self.read.len() == MOST_LIBRARIES {
                return Err(format!("more than {MOST_LIBRARIES} material libraries"));
            }
            self.read.push(name.to_owned());
            match self.find(name).map(|found| read(&found)) {
                Some(Ok(bytes)) => {
                    self.budget.add(bytes.len());
                    self.library(&bytes).map_err(|found| format!("{}, {found}", quote(name.as_bytes())))?;
                }
                Some(Err(why)) => self.note(format!("material library {} {why}", quote(name.as_bytes()))),
                None => self.note(format!("material library {} is missing; drawn grey", quote(name.as_bytes()))),
            }
        }
        mesh.notes.append(&mut self.notes);
        Ok(())
    }

    /// Index in the mesh of the material of this name; `None` where no library has it. The error says what is wrong
    /// with its texture.
    pub(super) fn index(&mut self, name: &str, mesh: &mut Mesh) -> Result<Option<u32>, String> {
        if let Some(&index) = self.known.get(name) {
            return Ok(Some(index));
        }
        let Some(said) = self.said.get(name).cloned() else { return Ok(None) };
        let texture = match &said.texture {
            Some(file) => self.texture(file, said.clamp, mesh)?,
            None => None,
        };
        let mut colour = said.diffuse.unwrap_or([1.0; 3]);
        let shown = quote(name.as_bytes());
        if texture.is_some() && colour == [0.0; 3] {
            self.note(format!("material {shown}: a black Kd would hide its texture; taken as white"));
            colour = [1.0; 3];
        }
        if said.has_cut_out {
            self.note(format!("material {shown}: map_d ignored"));
        }
        let opacity = match (said.opacity, said.transparency) {
            (Some(opacity), _) => opacity,
            // Older programs write their opacity there. Nobody draws with a material that is not there at all.
            (None, Some(1.0)) => {
                self.note(format!("material {shown}: Tr 1 without `d` is taken as opaque"));
                1.0
            }
            (None, Some(transparency)) => 1.0 - transparency,
            (None, None) => 1.0,
        };
        let [r, g, b] = colour;
        let index = mesh.materials.len() as u32;
        mesh.materials.push(MeshMaterial {
            name: name.to_owned(),
            colour: Vec4::new(r, g, b, opacity),
            texture,
            alpha: if opacity < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque },
            two_sided: true,
        });
        self.known.insert(name.to_owned(), index);
        mesh.notes.append(&mut self.notes);
        Ok(Some(index))
    }

    pub(super) fn finish(self, mesh: &mut Mesh) {
        mesh.notes.extend(self.notes);
    }

    /// Reads the text of a library. The error names the line.
    fn library(&mut self, bytes: &[u8]) -> Result<(), String> {
        let mut current: Option<(String, Said)> = None;
        for (line, text) in (1_u64..).zip(bytes.split(|&b| b == b'\n')) {
            let text = text.trim_ascii();
            let (key, rest) = text.split_at(text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len()));
            let rest = rest.trim_ascii();
            if key == b"newmtl" {
                // Blanks count once, as in the `usemtl` that names it.
                let words: Vec<&[u8]> = rest.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).collect();
                let name = String::from_utf8_lossy(&words.join(&b' ')).into_owned();
                let before = current.replace((name, Said::default()));
                self.said.extend(before);
                continue;
            }
            let Some((_, said)) = &mut current else { continue };
            let values = |most: usize| -> Result<Vec<f32>, String> {
                let code = rest.split(|&b| b == b'#').next().unwrap_or_default();
                let words = code.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
                let parse = |word: &[u8]| {
                    let value = number(word).filter(|x| x.abs() <= 1e6).map(|x| x as f32);
                    value.ok_or_else(|| format!("line {line}: {}, which is no number to 1000000", quote(word)))
                };
                words.take(most).map(parse).collect()
            };
            match key {
                // `Kd spectral` and `Kd xyz` are names of other colours.
                b"Kd" if !rest.starts_with(b"spectral") && !rest.starts_with(b"xyz") => match values(3)?.as_slice() {
                    &[r, g, b] => said.diffuse = Some([r, g, b].map(|c| c.max(0.0))),
                    // One number stands for all.
                    &[all, ..] => said.diffuse = Some([all.max(0.0); 3]),
                    [] => return Err(format!("line {line}: `Kd` without numbers")),
                },
                b"d" if !rest.starts_with(b"-halo") => said.opacity = values(1)?.first().map(|d| d.clamp(0.0, 1.0)),
                b"Tr" => said.transparency = values(1)?.first().map(|d| d.clamp(0.0, 1.0)),
                b"map_Kd" => {
                    let (clamp, name) = options(rest);
                    said.clamp = clamp;
                    said.texture = (!name.is_empty()).then(|| String::from_utf8_lossy(name).into_owned());
                }
                b"map_d" => said.has_cut_out = true,
                _ => {}
            }
        }
        self.said.extend(current);
        Ok(())
    }

    fn texture(&mut self, name: &str, clamp: bool, mesh: &mut Mesh) -> Result<Option<u32>, String> {
        let key = (name.to_owned(), clamp);
        if let Some(&known) = self.textures.get(&key) {
            return Ok(known);
        }
        let shown = quote(name.as_bytes());
        let bytes = match self.find(name).map(|found| read(&found)) {
            Some(Ok(bytes)) => Some(bytes),
            Some(Err(why)) => {
                self.note(format!("texture {shown} {why}; drawn without"));
                None
            }
            None => {
                self.note(format!("texture {shown} is missing; drawn without"));
                None
            }
        };
        let mut found = None;
        if let Some(bytes) = bytes {
            self.budget.add(bytes.len());
            let wrap = if clamp { [Wrap::Clamp; 2] } else { [Wrap::Repeat; 2] };
            match texture::decode(&bytes, wrap, &mut self.budget) {
                Ok(texture) => {
                    found = Some(mesh.textures.len() as u32);
                    mesh.textures.push(texture);
                }
                Err(NoTexture::Unknown(why)) => self.note(format!("texture {shown} is {why}; drawn without")),
                Err(NoTexture::Broken(why)) => return Err(format!("texture {shown}, {why}")),
            }
        }
        self.textures.insert(key, found);
        Ok(found)
    }

    /// The file that a library or an OBJ means.
    fn find(&self, name: &str) -> Option<PathBuf> {
        let name = name.replace('\\', "/");
        let name = name.trim_matches('"');
        let parts: Vec<&str> = name.split('/').filter(|part| !part.is_empty() && *part != ".").collect();
        let from = parts.len().saturating_sub(MOST_FOLDERS);
        let tails = (from..parts.len()).map(|first| parts[first..].join("/"));
        tails.filter_map(|tail| beside(self.path, &tail).ok()).find(|found| found.is_file())
    }

    fn note(&mut self, note: String) {
        if self.notes.len() < MOST_NOTES {
            self.notes.push(note);
        }
    }
}

/// The name of a `map_Kd` without its options, and whether the image is clamped.
fn options(text: &[u8]) -> (bool, &[u8]) {
    let (mut clamp, mut rest) = (false, text);
    let word = |text: &[u8]| text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
    while rest.first() == Some(&b'-') {
        let (option, after) = rest.split_at(word(rest));
        // Numbers that follow, of which some may be left out, or one word.
        let (numbers, words) = match option {
            b"-s" | b"-o" | b"-t" => (3, 0),
            b"-mm" => (2, 0),
            b"-bm" | b"-boost" | b"-texres" => (1, 0),
            b"-blendu" | b"-blendv" | b"-cc" | b"-clamp" | b"-imfchan" | b"-type" => (0, 1),
            _ => return (clamp, rest),
        };
        rest = after.trim_ascii_start();
        for _ in 0..numbers {
            let (value, after) = rest.split_at(word(rest));
            if number(value).is_none() {
                break;
            }
            rest = after.trim_ascii_start();
        }
        for _ in 0..words {
            let (value, after) = rest.split_at(word(rest));
            clamp |= option == b"-clamp" && value == b"on";
            rest = after.trim_ascii_start();
        }
    }
    (clamp, rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_come_before_the_name() {
        assert_eq!(options(b"fuze uv.jpg"), (false, b"fuze uv.jpg".as_slice()));
        assert_eq!(options(b"-s 1 2 3 -o 0.5 a b.png"), (false, b"a b.png".as_slice()));
        assert_eq!(options(b"-clamp on  a.png"), (true, b"a.png".as_slice()));
        assert_eq!(options(b"-unknown a.png"), (false, b"-unknown a.png".as_slice()));
    }
}
