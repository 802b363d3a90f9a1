//! Maps of numbers to colours: those of the field, and those of one's own.

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use glam::Vec3;

use super::error::{ModelError, ParseError, quote};
use super::ply_body::number;
use crate::files;
use crate::math::srgb;

/// Fewest and most colours of a map of one's own.
const COLOURS: std::ops::RangeInclusive<usize> = 2..=65_536;
/// Largest table of colours, bytes.
const MOST_BYTES: u64 = 1 << 22;

/// 256 colours of Smith and van der Walt 2015 (CC0).
const VIRIDIS: &str = "\
    44015444025645045745055946075a46085c460a5d460b5e470d60470e6147106347116447136548146748166848176948186a481a6c\
    481b6d481c6e481d6f481f70482071482173482374482475482576482677482878482979472a7a472c7a472d7b472e7c472f7d46307e\
    46327e46337f463480453581453781453882443983443a83443b84433d84433e85423f85424086424186414287414487404588404688\
    3f47883f48893e49893e4a893e4c8a3d4d8a3d4e8a3c4f8a3c508b3b518b3b528b3a538b3a548c39558c39568c38588c38598c375a8c\
    375b8d365c8d365d8d355e8d355f8d34608d34618d33628d33638d32648e32658e31668e31678e31688e30698e306a8e2f6b8e2f6c8e\
    2e6d8e2e6e8e2e6f8e2d708e2d718e2c718e2c728e2c738e2b748e2b758e2a768e2a778e2a788e29798e297a8e297b8e287c8e287d8e\
    277e8e277f8e27808e26818e26828e26828e25838e25848e25858e24868e24878e23888e23898e238a8d228b8d228c8d228d8d218e8d\
    218f8d21908d21918c20928c20928c20938c1f948c1f958b1f968b1f978b1f988b1f998a1f9a8a1e9b8a1e9c891e9d891f9e891f9f88\
    1fa0881fa1881fa1871fa28720a38620a48621a58521a68522a78522a88423a98324aa8325ab8225ac8226ad8127ad8128ae8029af7f\
    2ab07f2cb17e2db27d2eb37c2fb47c31b57b32b67a34b67935b77937b87838b9773aba763bbb753dbc743fbc7340bd7242be7144bf70\
    46c06f48c16e4ac16d4cc26c4ec36b50c46a52c56954c56856c66758c7655ac8645cc8635ec96260ca6063cb5f65cb5e67cc5c69cd5b\
    6ccd5a6ece5870cf5773d05675d05477d1537ad1517cd2507fd34e81d34d84d44b86d54989d5488bd6468ed64590d74393d74195d840\
    98d83e9bd93c9dd93ba0da39a2da37a5db36a8db34aadc32addc30b0dd2fb2dd2db5de2bb8de29bade28bddf26c0df25c2df23c5e021\
    c8e020cae11fcde11dd0e11cd2e21bd5e21ad8e219dae319dde318dfe318e2e418e5e419e7e419eae51aece51befe51cf1e51df4e61e\
    f6e620f8e621fbe723fde725";

/// 256 colours of Smith and van der Walt 2015 (CC0).
const PLASMA: &str = "\
    0d088710078813078916078a19068c1b068d1d068e20068f2206902406912605912805922a05932c05942e05952f0596310597330597\
    35049837049938049a3a049a3c049b3e049c3f049c41049d43039e44039e46039f48039f4903a04b03a14c02a14e02a25002a25102a3\
    5302a35502a45601a45801a45901a55b01a55c01a65e01a66001a66100a76300a76400a76600a76700a86900a86a00a86c00a86e00a8\
    6f00a87100a87201a87401a87501a87701a87801a87a02a87b02a87d03a87e03a88004a88104a78305a78405a78606a68707a68808a6\
    8a09a58b0aa58d0ba58e0ca48f0da4910ea3920fa39410a29511a19613a19814a099159f9a169f9c179e9d189d9e199da01a9ca11b9b\
    a21d9aa31e9aa51f99a62098a72197a82296aa2395ab2494ac2694ad2793ae2892b02991b12a90b22b8fb32c8eb42e8db52f8cb6308b\
    b7318ab83289ba3388bb3488bc3587bd3786be3885bf3984c03a83c13b82c23c81c33d80c43e7fc5407ec6417dc7427cc8437bc9447a\
    ca457acb4679cc4778cc4977cd4a76ce4b75cf4c74d04d73d14e72d24f71d35171d45270d5536fd5546ed6556dd7566cd8576bd9586a\
    da5a6ada5b69db5c68dc5d67dd5e66de5f65de6164df6263e06363e16462e26561e26660e3685fe4695ee56a5de56b5de66c5ce76e5b\
    e76f5ae87059e97158e97257ea7457eb7556eb7655ec7754ed7953ed7a52ee7b51ef7c51ef7e50f07f4ff0804ef1814df1834cf2844b\
    f3854bf3874af48849f48948f58b47f58c46f68d45f68f44f79044f79143f79342f89441f89540f9973ff9983ef99a3efa9b3dfa9c3c\
    fa9e3bfb9f3afba139fba238fca338fca537fca636fca835fca934fdab33fdac33fdae32fdaf31fdb130fdb22ffdb42ffdb52efeb72d\
    feb82cfeba2cfebb2bfebd2afebe2afec029fdc229fdc328fdc527fdc627fdc827fdca26fdcb26fccd25fcce25fcd025fcd225fbd324\
    fbd524fbd724fad824fada24f9dc24f9dd25f8df25f8e125f7e225f7e425f6e626f6e826f5e926f5eb27f4ed27f3ee27f3f027f2f227\
    f1f426f1f525f0f724f0f921";

/// 256 colours of Mikhailov 2019 (Google, Apache License 2.0).
const TURBO: &str = "\
    30123b32154333184a341b51351e5836215f37246638276d392a733a2d793b2f803c32863d358b3e38913f3b973f3e9c4040a24143a7\
    4146ac4249b1424bb5434eba4451bf4454c34456c74559cb455ccf455ed34661d64664da4666dd4669e0466be3476ee64771e94773eb\
    4776ee4778f0477bf2467df44680f64682f84685fa4687fb458afc458cfd448ffe4391fe4294ff4196ff4099ff3e9bfe3d9efe3ba0fd\
    3aa3fc38a5fb37a8fa35abf833adf731aff52fb2f42eb4f22cb7f02ab9ee28bceb27bee925c0e723c3e422c5e220c7df1fc9dd1ecbda\
    1ccdd81bd0d51ad2d21ad4d019d5cd18d7ca18d9c818dbc518ddc218dec018e0bd19e2bb19e3b91ae4b61ce6b41de7b21fe9af20eaac\
    22ebaa25eca727eea42aefa12cf09e2ff19b32f29835f39438f4913cf58e3ff68a43f78746f8844af8804ef97d52fa7a55fa7659fb73\
    5dfc6f61fc6c65fd6969fd666dfe6271fe5f75fe5c79fe597dff5680ff5384ff5188ff4e8bff4b8fff4992ff4796fe4499fe429cfe40\
    9ffd3fa1fd3da4fc3ca7fc3aa9fb39acfb38affa37b1f936b4f836b7f735b9f635bcf534bef434c1f334c3f134c6f034c8ef34cbed34\
    cdec34d0ea34d2e935d4e735d7e535d9e436dbe236dde037dfdf37e1dd37e3db38e5d938e7d739e9d539ebd339ecd13aeecf3aefcd3a\
    f1cb3af2c93af4c73af5c53af6c33af7c13af8be39f9bc39faba39fbb838fbb637fcb336fcb136fdae35fdac34fea933fea732fea431\
    fea130fe9e2ffe9b2dfe992cfe962bfe932afe9029fd8d27fd8a26fc8725fc8423fb8122fb7e21fa7b1ff9781ef9751df8721cf76f1a\
    f66c19f56918f46617f36315f26014f15d13f05b12ef5811ed5510ec530feb500eea4e0de84b0ce7490ce5470be4450ae2430ae14109\
    df3f08dd3d08dc3b07da3907d83706d63506d43305d23105d02f05ce2d04cc2b04ca2a04c82803c52603c32503c12302be2102bc2002\
    b91e02b71d02b41b01b21a01af1801ac1701a91601a71401a41301a112019e10019b0f01980e01950d01920b018e0a018b0902880802\
    8507028106027e05027a0403";

/// 33 colours of Moreland 2009.
const COOLWARM: &str = "\
    3b4cc0445acc4d68d75775e16282ea6c8ef1779af782a5fb8db0fe98b9ffa3c2ffaec9fdb8d0f9c2d5f4ccd9eed5dbe6dddddde5d8d1\
    ecd3c5f1ccb9f5c4adf7bba0f7b194f7a687f49a7bf18d6fec7f63e57058de604dd55042cb3e38c0282fb40426";

/// The maps that have a name, and their colours.
const NAMED: [(&str, &str); 5] =
    [("viridis", VIRIDIS), ("turbo", TURBO), ("plasma", PLASMA), ("grey", "000000ffffff"), ("coolwarm", COOLWARM)];

/// Colours along a line from 0 to 1, equally far apart; between two of them their codes change linearly.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourMap {
    text: String,
    /// Is `text` the path of a table?
    is_table: bool,
    /// Encoded sRGB, 0 to 1; two at least.
    colours: Arc<[[f32; 3]]>,
}

impl Default for ColourMap {
    fn default() -> Self {
        Self::of_hex("viridis", VIRIDIS.bytes()).unwrap_or(Self {
            text: String::new(),
            is_table: false,
            colours: Arc::new([]),
        })
    }
}

impl fmt::Display for ColourMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl ColourMap {
    /// The names of the maps of the field.
    pub const WORDS: [&str; 5] = ["viridis", "turbo", "plasma", "grey", "coolwarm"];

    /// The map of a name, or of colours as `#000004,#b63679,#fcfdbf`; `None` for what is neither, as the path of a
    /// table.
    pub fn parse(text: &str) -> Option<Self> {
        if let Some((name, colours)) = NAMED.iter().find(|(name, _)| *name == text) {
            return Self::of_hex(name, colours.bytes());
        }
        let words = || text.split([',', ' ']).filter(|word| !word.is_empty());
        let is_colour = |word: &str| word.len() == 7 && word.starts_with('#');
        if !words().all(is_colour) || !COLOURS.contains(&words().count()) {
            return None;
        }
        Self::of_hex(text, words().flat_map(|word| word.bytes().skip(1)))
    }

    /// The map of a name, of a list of colours, or of the table in a file.
    ///
    /// # Errors
    /// It is neither of the first two, and the file cannot be read, or is no such table.
    pub fn open(text: &str) -> Result<Self, ModelError> {
        Self::parse(text).map_or_else(|| Self::read(Path::new(text)), Ok)
    }

    /// The map of the table in a file: a line for each colour, of three numbers, which are all from 0 to 1, or from 0
    /// to 255. A first line of words and lines that begin with `#` are left out.
    ///
    /// # Errors
    /// The file cannot be read, or is no such table.
    pub fn read(path: &Path) -> Result<Self, ModelError> {
        let bytes = files::read(path, MOST_BYTES).map_err(|why| ModelError::of_input(path, why))?;
        Self::of_table(&path.to_string_lossy(), &bytes)
            .map_err(|why| ModelError::Invalid { path: path.to_owned(), why })
    }

    /// Is it that of a file, whose path is its text?
    pub fn is_table(&self) -> bool {
        self.is_table
    }

    /// The map of a table: a line for each colour, of three numbers, which are all from 0 to 1, or all whole numbers
    /// from 0 to 255. A first line of words and lines that begin with `#` are left out.
    ///
    /// # Errors
    /// The error names the line. Something is no such number, or there are fewer than two colours, or more than 65,536.
    fn of_table(text: &str, bytes: &[u8]) -> Result<Self, ParseError> {
        const EXPECTED: &str = "three numbers from 0 to 1, or from 0 to 255";
        let mut colours: Vec<[f32; 3]> = Vec::new();
        for (line, row) in (1..).zip(bytes.split(|byte| *byte == b'\n')) {
            let words: Vec<&[u8]> = row
                .split(|byte| byte.is_ascii_whitespace() || matches!(byte, b',' | b';'))
                .filter(|word| !word.is_empty())
                .collect();
            let is_head = line == 1 && words.iter().all(|word| number(word).is_none());
            if words.is_empty() || words[0].starts_with(b"#") || is_head {
                continue;
            }
            let [r, g, b] = words[..] else {
                return Err(ParseError::line(line, format!("{} words", words.len()), EXPECTED));
            };
            let mut colour = [0.0; 3];
            for (channel, word) in colour.iter_mut().zip([r, g, b]) {
                let value = number(word).filter(|value| (0.0..=255.0).contains(value));
                *channel = value.ok_or_else(|| ParseError::line(line, quote(word), EXPECTED))? as f32;
            }
            colours.push(colour);
        }
        if !COLOURS.contains(&colours.len()) {
            return Err(ParseError::line(1, format!("{} colours", colours.len()), "from 2 to 65,536"));
        }
        if colours.iter().flatten().any(|channel| *channel > 1.0) {
            colours.iter_mut().flatten().for_each(|channel| *channel /= 255.0);
        }
        Ok(Self { text: text.to_owned(), is_table: true, colours: colours.into() })
    }

    /// Six digits for each colour, of which there are two at least.
    fn of_hex(text: &str, digits: impl Iterator<Item = u8>) -> Option<Self> {
        let digits: Option<Vec<u32>> = digits.map(|digit| char::from(digit).to_digit(16)).collect();
        let digits = digits?;
        let channel = |pair: &[u32]| (16 * pair[0] + pair[1]) as f32 / 255.0;
        let colours = digits.chunks_exact(6).map(|six| [0, 2, 4].map(|at| channel(&six[at..at + 2])));
        Some(Self { text: text.to_owned(), is_table: false, colours: colours.collect() })
    }

    /// The colour at `t`, which is limited to 0 to 1: encoded sRGB, 0 to 1. NaN has none.
    pub fn encoded(&self, t: f64) -> Option<[f32; 3]> {
        if t.is_nan() {
            return None;
        }
        let last = self.colours.len().checked_sub(1)?;
        let along = t.clamp(0.0, 1.0) * last as f64;
        let low = (along as usize).min(last.saturating_sub(1));
        let share = (along - low as f64) as f32;
        let (a, b) = (self.colours.get(low)?, self.colours.get(low + 1)?);
        Some([0, 1, 2].map(|c| a[c] + (b[c] - a[c]) * share))
    }

    /// The same in linear light.
    pub fn linear(&self, t: f64) -> Option<Vec3> {
        self.encoded(t).map(|colour| Vec3::from(colour.map(srgb::to_linear)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn codes(map: &ColourMap, t: f64) -> [u8; 3] {
        map.encoded(t).unwrap().map(|channel| (channel * 255.0).round() as u8)
    }

    /// Colours at the ends and in the middle as Matplotlib 3.11 gives them.
    #[test]
    fn maps_of_the_field_have_their_colours() {
        let want = [
            (
                "viridis",
                [
                    (0.0 / 255.0, [68, 1, 84]),
                    (51.0 / 255.0, [65, 68, 135]),
                    (102.0 / 255.0, [42, 120, 142]),
                    (153.0 / 255.0, [34, 168, 132]),
                    (204.0 / 255.0, [122, 209, 81]),
                    (255.0 / 255.0, [253, 231, 37]),
                ],
            ),
            (
                "turbo",
                [
                    (0.0 / 255.0, [48, 18, 59]),
                    (51.0 / 255.0, [62, 155, 254]),
                    (102.0 / 255.0, [70, 248, 132]),
                    (153.0 / 255.0, [225, 221, 55]),
                    (204.0 / 255.0, [240, 91, 18]),
                    (255.0 / 255.0, [122, 4, 3]),
                ],
            ),
            (
                "plasma",
                [
                    (0.0 / 255.0, [13, 8, 135]),
                    (51.0 / 255.0, [106, 0, 168]),
                    (102.0 / 255.0, [177, 42, 144]),
                    (153.0 / 255.0, [225, 100, 98]),
                    (204.0 / 255.0, [252, 166, 54]),
                    (255.0 / 255.0, [240, 249, 33]),
                ],
            ),
            (
                "coolwarm",
                [
                    (0.0 / 255.0, [59, 76, 192]),
                    (51.0 / 255.0, [123, 159, 249]),
                    (102.0 / 255.0, [192, 212, 245]),
                    (153.0 / 255.0, [242, 203, 183]),
                    (204.0 / 255.0, [238, 132, 104]),
                    (255.0 / 255.0, [180, 4, 38]),
                ],
            ),
        ];
        assert_eq!(ColourMap::WORDS, NAMED.map(|(name, _)| name));
        for (name, stops) in want {
            let map = ColourMap::parse(name).unwrap();
            for (t, colour) in stops {
                // The table of coolwarm has 33 colours, and Matplotlib's 256 lie between them.
                let got = codes(&map, t);
                let far = got.iter().zip(colour).any(|(a, b)| a.abs_diff(b) > 1);
                assert!(!far, "{name} at {t}: {got:?}, not {colour:?}");
            }
        }
    }

    #[test]
    fn colours_of_ones_own() {
        let map = ColourMap::parse("#000000,#ff0000 #ffffff").unwrap();
        assert_eq!([0.0, 0.25, 0.5, 0.75, 1.0, 7.0].map(|t| codes(&map, t)[0]), [0, 128, 255, 255, 255, 255]);
        assert_eq!(codes(&map, 0.75), [255, 128, 128]);
        assert_eq!(map.encoded(f64::NAN), None);
        for wrong in ["", "#000000", "#00000g,#000000", "red,blue", "viridi", "#000000,#00"] {
            assert_eq!(ColourMap::parse(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn tables_of_ones_own() {
        let table = |text: &str| ColourMap::of_table("t", text.as_bytes()).map_err(|why| why.to_string());
        let same = table("0 0 0\n255 0 0\n255 255 255\n").unwrap();
        assert_eq!(same, table("r,g,b\n# black\n0,0,0\n1,0,0\n1,1,1").unwrap());
        assert_eq!(codes(&same, 0.5), [255, 0, 0]);
        assert!(table("0 0 0\n").unwrap_err().contains("1 colours"));
        assert!(table("0 0 0\n1 2\n").unwrap_err().contains("line 2: found 2 words"));
        assert!(table("0 0 0\n1 2 300\n").unwrap_err().contains("line 2: found `300`"));
        assert!(table("0 0 0\n1 2 nan\n").unwrap_err().contains("line 2: found `nan`"));
    }
}
