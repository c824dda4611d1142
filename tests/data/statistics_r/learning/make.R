# The power law of practice: lm of log time on log trial number of each participant in each condition, and t tests of the
# slopes, of invented times with some trials missing.
source("../folder_common.R")
set.seed(21)
rows <- do.call(rbind, lapply(1:10, function(i) do.call(rbind, lapply(1:3, function(j) {
  slope <- c(-0.25, -0.1, 0)[j] + rnorm(1, 0, 0.06)
  order <- 1:12
  data.frame(participant = i, condition = c("a", "b", "c")[j], order = order,
             time = round(exp(1 + rnorm(1, 0, 0.2) + slope * log(order) + rnorm(12, 0, 0.1)), 4))
}))))
rows <- rows[sample(nrow(rows)), ]
rows <- rows[-sample(nrow(rows), 40), ]
rows <- rows[!(rows$participant == 4 & rows$condition == "c" & rows$order != 2), ]
slope <- sapply(c("a", "b", "c"), function(j) sapply(1:10, function(i) {
  d <- rows[rows$participant == i & rows$condition == j, ]
  if (length(unique(d$order)) < 2) NA else unname(coef(lm(log(time) ~ log(order), d))[2])
}))
told <- function(t, x) list(t = unname(t$statistic), df = unname(t$parameter), p = t$p.value, mean = mean(x), ci = as.vector(t$conf.int), dz = mean(x) / sd(x), n = length(x))
one <- function(x) { x <- x[!is.na(x)]; told(t.test(x), x) }
save_data(rows)
save_expected(list(
  a = one(slope[, "a"]), b = one(slope[, "b"]), c = one(slope[, "c"]),
  `a - b` = one(slope[, "a"] - slope[, "b"]), `a - c` = one(slope[, "a"] - slope[, "c"]), `b - c` = one(slope[, "b"] - slope[, "c"])
))
