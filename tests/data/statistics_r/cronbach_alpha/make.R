# Cronbach's alpha and Feldt's interval by psych, of invented ratings: a scale that agrees, one that does not.
source("../folder_common.R")
suppressMessages(library(psych))
set.seed(11)
of <- function(n, k, noise) {
  person <- rnorm(n)
  pmin(pmax(round(4 + 1.3 * (person + matrix(rnorm(n * k, sd = noise), n, k))), 1), 7)
}
cases <- list(agreeing = of(12, 4, 0.3), loose = of(15, 6, 1.8), two_items = of(9, 2, 0.8), opposed = NULL)
x <- of(10, 1, 1)
cases$opposed <- cbind(x, 8 - pmin(pmax(x + sample(-1:1, 10, TRUE), 1), 7))  # an item that somebody forgot to reverse
rows <- do.call(rbind, lapply(names(cases), function(name) {
  m <- cases[[name]]
  data.frame(case = name, row = rep(seq_len(nrow(m)), ncol(m)), item = rep(seq_len(ncol(m)), each = nrow(m)), rating = as.vector(m))
}))
save_data(rows)
save_expected(lapply(cases, function(m) {
  a <- suppressWarnings(suppressMessages(alpha(as.data.frame(m), check.keys = FALSE, warnings = FALSE)))
  list(alpha = a$total$raw_alpha, feldt = c(a$feldt$lower.ci[[1]], a$feldt$upper.ci[[1]]))
}), "psych")
