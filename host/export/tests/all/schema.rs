//! The published schema equals the one generated from the types.

#[test]
fn the_schema_in_the_documentation_is_that_of_the_types() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../docs/calibration.schema.json"
    );
    let ours = mimu_export::json::schema();
    if std::env::var_os("MIMU_WRITE").is_some() {
        std::fs::write(path, &ours).unwrap();
    }
    let published = std::fs::read_to_string(path).unwrap_or_default();
    assert!(
        ours == published,
        "docs/calibration.schema.json is not that of the types: run this test with MIMU_WRITE=1, and look at what has changed"
    );
}
