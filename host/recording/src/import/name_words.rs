//! Words of which the names of columns consist.

/// Words of a time, also in German, Portuguese and Italian, Spanish, French and Dutch.
pub(super) const TIME: &str = "t ts time times timestamp timestamps stamp sec secs second seconds ms us ns millis micros elapsed timeelapsed elapsedtime \
    secondselapsed timeus timems timens sampletime sampletimefine systemtime loggingtime datetime utc clock epoch headerstamp timeusec timesec \
    zeit tempo tiempo temps tijd";

/// Whether `word` is in a list of words.
pub(super) fn is_in(list: &str, word: &str) -> bool {
    list.split_whitespace().any(|known| known == word)
}

/// Cuts a name into words in lower case: at signs, before capitals, around digits.
pub(super) fn words(name: &str) -> Vec<String> {
    let mut words = Vec::new();
    let mut word = String::new();
    let mut before = ' ';
    let mut letters = name.chars().peekable();
    while let Some(c) = letters.next() {
        // `gyroADC`, `GyroX`, and `ACCx` in another way.
        let capital = c.is_uppercase() && before.is_lowercase();
        let last_capital = c.is_uppercase()
            && before.is_uppercase()
            && letters.peek().is_some_and(|next| next.is_lowercase());
        let digit = c.is_ascii_digit() != before.is_ascii_digit();
        let cut = !c.is_alphanumeric() || capital || last_capital || digit;
        if cut && !word.is_empty() {
            words.push(std::mem::take(&mut word));
        }
        if c.is_alphanumeric() {
            word.extend(c.to_lowercase());
        }
        before = c;
    }
    if !word.is_empty() {
        words.push(word);
    }
    words
}
