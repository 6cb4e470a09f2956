//! Text for people.

/// The text with a capital first letter.
pub fn capitalized(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_letter_becomes_a_capital_and_no_other() {
        assert_eq!(["", "a b", "éa", "1 mm"].map(capitalized), ["", "A b", "Éa", "1 mm"]);
    }
}
