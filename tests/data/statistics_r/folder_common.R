# What every script of these folders begins with: source("../folder_common.R"), then write(list(...)).
# A script makes its data (seeded) and expected.json anew: cd NAME && Rscript make.R
options(digits = 17, warn = 1)
suppressMessages(library(jsonlite))

versions <- function(...) {
  named <- c(...)
  c(list(R = as.character(getRversion())),
    setNames(lapply(named, function(p) as.character(packageVersion(p))), named))
}

# NaN, NA and Inf become strings, so that the file stays plain JSON.
plain <- function(x) {
  if (is.list(x)) return(lapply(x, plain))
  if (is.numeric(x) && any(!is.finite(x))) return(lapply(x, function(v) if (is.finite(v)) unbox(v) else unbox(as.character(v))))
  if (length(x) == 1 && is.atomic(x) && is.null(names(x))) return(unbox(x))
  x
}

save_expected <- function(x, packages = character()) {
  x <- c(list(versions = versions(packages)), x)
  writeLines(toJSON(plain(x), digits = NA, pretty = TRUE, auto_unbox = FALSE), "expected.json")
}

save_data <- function(frame, name = "data.csv") write.csv(frame, name, row.names = FALSE, quote = FALSE)
