# Friedman's exact p by writing out every order of every participant's ranks (the first one's held), in whole numbers.
source("../folder_common.R")
set.seed(7)
permutations <- function(v) {
  if (length(v) == 1) return(matrix(v, 1))
  do.call(rbind, lapply(seq_along(v), function(i) cbind(v[i], permutations(v[-i]))))
}
ties <- function(n, k, from) matrix(sample(from, n * k, TRUE), n, k)
cases <- list(
  no_ties_k3_n6 = matrix(round(rnorm(18, rep(c(0, 0.5, 1), each = 6)), 3), 6),
  ties_k3_n6 = ties(6, 3, 1:4),
  no_ties_k4_n5 = matrix(round(rnorm(20, rep(c(0, 0.3, 0.6, 1.4), each = 5)), 3), 5),
  ties_k4_n5 = ties(5, 4, 1:5),
  of_one_mind_k3_n5 = t(replicate(5, c(1, 2, 3))),
  two_conditions = cbind(c(5, 6, 7, 5, 4), c(6, 7, 9, 6, 5.5)),
  two_conditions_with_zero = cbind(c(5, 6, 7, 5, 4, 3, 2, 8), c(6, 7, 9, 4, 5.5, 3, 4, 9))
)
exact <- function(m) {
  ranks <- 2 * t(apply(m, 1, rank))
  found <- sum(colSums(ranks)^2)
  sums <- matrix(ranks[1, ], 1)
  for (i in 2:nrow(ranks)) {
    p <- permutations(ranks[i, ])
    sums <- do.call(rbind, lapply(seq_len(nrow(p)), function(j) sweep(sums, 2, p[j, ], "+")))
  }
  mean(rowSums(sums^2) >= found)
}
rows <- do.call(rbind, lapply(names(cases), function(name) {
  m <- cases[[name]]
  data.frame(case = name, participant = as.vector(row(m)), condition = as.vector(col(m)), value = as.vector(m))
}))
save_data(rows)
save_expected(lapply(cases, function(m) {
  f <- friedman.test(m)
  list(chi2 = unname(f$statistic), chi2_p = f$p.value, exact_p = exact(m))
}))
