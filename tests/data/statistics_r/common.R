# What all scripts here share: each invents data from a seed, writes NAME/data.csv, and what R computes of it to
# NAME/expected.json. Run from the clone: Rscript tests/data/statistics_r/between.R
library(jsonlite)

here <- "tests/data/statistics_r"

versions <- function(packages) {
  installed <- lapply(packages, function(package) as.character(packageVersion(package)))
  c(list(R = R.version.string), setNames(installed, packages))
}

write_case <- function(name, data, expected, packages) {
  folder <- file.path(here, name)
  dir.create(folder, showWarnings = FALSE)
  write.csv(data, file.path(folder, "data.csv"), row.names = FALSE, quote = FALSE)
  content <- c(list(case = name), expected, list(versions = versions(packages)))
  writeLines(toJSON(content, auto_unbox = TRUE, digits = NA, na = "string", null = "null"), file.path(folder, "expected.json"))
}
