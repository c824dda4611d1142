# Fitts' law of invented movements: lm of mean times on the index of difficulty, nominal and effective.
source("../folder_common.R")
set.seed(33)
design <- expand.grid(amplitude = c(64, 128, 256), width = c(8, 16, 32))
rows <- do.call(rbind, lapply(seq_len(nrow(design)), function(i) {
  a <- design$amplitude[i]; w <- design$width[i]; n <- 10 + i
  data.frame(amplitude = a, width = w, block = paste0(a, "x", w), moved = round(a + rnorm(n, 0, w / 5), 3),
             deviation = round(rnorm(n, 0, w / 4.5), 3), time = round(0.1 + 0.15 * log2(a / w + 1) + rnorm(n, 0, 0.05), 4))
}))
rows <- rows[sample(nrow(rows)), ]
line <- function(id, mt) {
  m <- lm(mt ~ id)
  list(intercept = unname(coef(m)[1]), slope = unname(coef(m)[2]), ci_intercept = as.vector(confint(m)[1, ]),
       ci_slope = as.vector(confint(m)[2, ]), r_squared = summary(m)$r.squared, throughput = mean(id / mt), blocks = length(id))
}
by_block <- function(f, x) as.vector(tapply(x, rows$block, f))
mt <- by_block(mean, rows$time)
a <- by_block(mean, rows$amplitude); w <- by_block(mean, rows$width)
ae <- by_block(mean, rows$moved); we <- 4.133 * by_block(sd, rows$deviation)
save_data(rows)
save_expected(list(nominal = line(log2(a / w + 1), mt), effective = line(log2(ae / we + 1), mt)))
