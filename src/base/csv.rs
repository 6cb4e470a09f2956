//! CSV files of numbers with a header, as the commands read them.

use std::io::Read;
use std::path::{Path, PathBuf};

use super::{InputError, Result, regular_file};

/// Largest size of a file [bytes].
const MAX_FILE: u64 = 1 << 30;

/// A CSV file: a line of column names, then a line per row. Empty lines and lines that begin with `#` are ignored.
#[derive(Debug)]
pub struct CsvFile {
    path: PathBuf,
    text: String,
    names: Vec<String>,
}

/// A row of a [`CsvFile`].
#[derive(Debug)]
pub struct CsvRow<'a> {
    file: &'a CsvFile,
    line: usize,
    fields: Vec<&'a str>,
}

impl CsvFile {
    /// Reads a file; `-` is standard input.
    ///
    /// # Errors
    /// The file cannot be read, it is empty, or a column occurs twice.
    pub fn read(path: &Path, expected_header: &str) -> Result<Self> {
        let mut text = String::new();
        let got = if path == Path::new("-") {
            std::io::stdin().lock().take(MAX_FILE).read_to_string(&mut text)
        } else {
            regular_file::open(path).and_then(|file| file.take(MAX_FILE).read_to_string(&mut text))
        };
        let mut file = Self { path: path.to_owned(), text, names: Vec::new() };
        got.map_err(|error| file.error(String::new(), error.to_string(), "a CSV file that can be read"))?;
        let names =
            file.lines().next().map(|(_, header)| header.split(',').map(|name| name.trim().to_owned()).collect());
        file.names =
            names.ok_or_else(|| file.error("line 1".to_owned(), "an empty file".to_owned(), expected_header))?;
        let is_again = |at: &usize| !file.names[*at].is_empty() && file.names[..*at].contains(&file.names[*at]);
        if let Some(again) = (0..file.names.len()).find(is_again) {
            let found = format!("the column `{}` twice", file.names[again]);
            return Err(file.error("line 1".to_owned(), found, "each column once").into());
        }
        Ok(file)
    }

    /// The column names.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// An error in the header.
    pub fn header_error(&self, expected: &str) -> InputError {
        self.error("line 1".to_owned(), format!("the columns {}", self.names.join(",")), expected)
    }

    /// The rows below the header.
    pub fn rows(&self) -> impl Iterator<Item = CsvRow<'_>> {
        self.lines().skip(1).map(|(line, text)| CsvRow {
            file: self,
            line,
            fields: text.split(',').map(str::trim).collect(),
        })
    }

    fn lines(&self) -> impl Iterator<Item = (usize, &str)> {
        // Spreadsheets begin a file with a byte-order mark.
        let text = self.text.trim_start_matches('\u{feff}');
        text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'))
    }

    fn error(&self, place: String, found: String, expected: &str) -> InputError {
        InputError::new(place, found, expected).in_file(&self.path)
    }
}

impl CsvRow<'_> {
    /// Number of values.
    #[expect(clippy::len_without_is_empty, reason = "a row has at least one value")]
    pub fn len(&self) -> usize {
        self.fields.len()
    }

    /// Error of a row whose number of values is not that of the columns.
    pub fn length_error(&self) -> InputError {
        let expected = format!("{} values", self.file.names.len());
        self.file.error(self.place(), format!("{} values", self.fields.len()), &expected)
    }

    /// The finite number in a column, if `accepts` returns true for it.
    ///
    /// # Errors
    /// The row has no such column, or the field is not such a number; `expected` describes it.
    pub fn number(&self, column: usize, expected: &str, accepts: impl Fn(f64) -> bool) -> Result<f64> {
        let field = *self.fields.get(column).ok_or_else(|| self.length_error())?;
        let value = field.parse::<f64>().ok().filter(|value| value.is_finite() && accepts(*value));
        value.ok_or_else(|| {
            let found = format!("`{field}` for {}", self.file.names[column]);
            self.file.error(self.place(), found, expected).into()
        })
    }

    fn place(&self) -> String {
        format!("line {}", self.line + 1)
    }
}
