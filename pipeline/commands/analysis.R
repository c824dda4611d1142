# Reads a study's tables and computes its comparisons anew. Run it in this folder:
#
#     Rscript analysis.R
#
# Packages: none are needed for t tests and rank tests; afex for analyses of variance, lmerTest for mixed models,
# BayesFactor for Bayes factors. What the columns of the tables mean stands in tables/dictionary.csv.

if (!file.exists("tables")) stop("run this script in the folder that it stands in")
tables <- lapply(setNames(nm = sub("\\.csv$", "", list.files("tables", pattern = "\\.csv$"))), function(name)
  read.csv(file.path("tables", paste0(name, ".csv")), na.strings = "", fileEncoding = "UTF-8"))

# Each participant's values, one row each: tables$measures has participant, condition, measure and value.
if (!is.null(tables$measures)) {
  means <- aggregate(value ~ condition + measure, tables$measures, mean)
  cat("Means by condition:\n")
  print(means[order(means$measure), c("measure", "condition", "value")], row.names = FALSE)
}

# The comparisons: recomputed/values.csv holds the values of the complete participants of each, and
# recomputed/recompute.R says by which function of R each is computed.
ours <- read.csv(file.path("recomputed", "steadyhand.csv"), na.strings = "NA", fileEncoding = "UTF-8")
if (nrow(ours)) {
  here <- setwd("recomputed")
  unlink("answers.csv")
  source("recompute.R", local = new.env())
  setwd(here)
  answers <- read.csv(file.path("recomputed", "answers.csv"), header = FALSE,
                      col.names = c("problem", "call", "figure", "in_r", "message"))
  wide <- merge(answers, ours, by = "problem")
  wide$steadyhand <- mapply(function(row, figure) {
    if (figure %in% names(wide)) as.numeric(wide[row, figure]) else NA_real_
  }, seq_len(nrow(wide)), wide$figure)
  cat("\nComparisons, in R and by Steadyhand:\n")
  wide <- wide[order(wide$problem, wide$call), ]
  for (row in split(wide, seq_len(nrow(wide)))) {
    what <- paste(c(row$measure, row$test, row$effect, if (!is.na(row$contrast)) row$contrast), collapse = ", ")
    cat(sprintf("%s, %s by %s: %s (Steadyhand: %s)%s\n", what, row$figure, row$call, format(row$in_r, digits = 6),
                format(row$steadyhand, digits = 6), if (is.na(row$message)) "" else row$message))
  }
  write.csv(wide, "comparisons_in_r.csv", row.names = FALSE)
}
